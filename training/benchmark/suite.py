"""The fixed benchmark: every method on the same sets, paired with the Bayes limit of those sets."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from datagen.recipe import Recipe, read_recipe
from soilml.errors import InputError
from soilml.identification import METHODS
from soilml.onboard.estimator import Estimator
from soilml.quantities import SHEAR
from training.benchmark.bayes_limit import BenchmarkSet, benchmark_sets
from training.benchmark.bayes_limit_file import BayesLimit, load_limit, packaged_limit
from training.benchmark.designs import Design, design_of
from training.benchmark.methods import (
    ANALYTIC_PREFIX,
    Method,
    MethodEstimates,
    MethodKind,
    UserMethod,
    analytic_method,
    model_file_method,
    prior_method,
    user_methods,
)
from training.benchmark.paired_results import PairedResult

Progress = Callable[[str, int, int], None]

RECIPE = "benchmark"  # The packaged recipe whose sets the benchmark has
#: Label of the exact posterior. On sets with an unmodelled effect it is no limit, and has the label
#: of the analytic method that it is.
LIMIT_LABEL, POSTERIOR_LABEL = "Bayes limit", f"{ANALYTIC_PREFIX}posterior"
#: Analytic methods of the benchmark; `posterior` is the limit itself.
ANALYTIC_METHODS = tuple(name for name in METHODS if name != "posterior")


def benchmark_methods(
    recipe: Recipe,
    estimators: Mapping[str, Estimator] | None = None,
    functions: Mapping[str, UserMethod] | None = None,
    analytic: Sequence[str] = ANALYTIC_METHODS,
) -> list[Method]:
    """The prior, model files, functions of the caller, and analytic methods by name.

    Raises `InputError` for a model file of other parameters, and for a label that occurs twice.
    """
    for label, estimator in (estimators or {}).items():
        if estimator.names != SHEAR:
            raise InputError(
                f"{label} estimates {', '.join(estimator.names)}; the benchmark needs an estimator "
                f"of {', '.join(SHEAR)}"
            )
    methods = [prior_method([recipe.case.prior[n] for n in SHEAR])]
    for label, estimator in (estimators or {}).items():
        methods.append(model_file_method(label, estimator))
    methods += user_methods(functions or {})
    methods += [analytic_method(recipe.case, name, SHEAR) for name in analytic]
    labels = [LIMIT_LABEL, POSTERIOR_LABEL, *(m.label for m in methods)]
    for label in labels:
        if labels.count(label) > 1:
            raise InputError(f"two methods are called {label!r}: rename the file or function")
    return methods


def benchmark(
    estimators: Mapping[str, Estimator] | None = None,
    functions: Mapping[str, UserMethod] | None = None,
    max_sets: int | None = None,
    limit: str | os.PathLike[str] | None = None,
    progress: Progress = lambda text, done, total: None,
    analytic: Sequence[str] = ANALYTIC_METHODS,
) -> list[PairedResult]:
    """Score methods on the fixed sets of the packaged recipe, next to their Bayes limit.

    estimators: Model files by label, on the wheel of the recipe (see `for_simulated_case`).
    functions: Methods of the caller by label: slips (1), torques (N m) and loads (N) of one soil,
        each (rows,), to the mean (3,) and the standard deviation (3,) or covariance (3, 3) of
        cohesion (Pa), friction angle (rad) and shear modulus (m). A `FitError` counts as a failed
        set.
    max_sets: Number of sets of each design, in order; all where it is None.
    limit: File of `soilml compare --limit`; the packaged one where it is None.
    progress: Called with a description, the number of estimates done, and their total.
    analytic: Names of the analytic methods.

    Returns: For each design, without and with unmodelled effects: the Bayes limit first (with an
    effect, `analytic posterior`), then all methods.

    Raises `InputError` where `limit` lacks a set or is stale, an estimator has other parameters, or
    two methods have one label.

    Examples
    --------
    >>> import numpy as np
    >>> def prior_mean(slip, torque, load):
    ...     return np.array([1500.0, 0.61, 0.0175]), np.array([870.0, 0.1, 0.0072])
    >>> results = benchmark(functions={"prior mean": prior_mean}, max_sets=2, analytic=())
    >>> [r.method for r in results[:3]]
    ['Bayes limit', 'prior', 'prior mean']
    """
    recipe = read_recipe(RECIPE)
    methods = benchmark_methods(recipe, estimators, functions, analytic)
    sets = benchmark_sets(recipe, SHEAR, max_sets)
    posteriors = load_limit(limit or packaged_limit(), sets)
    designs = {design.key: design for design in map(design_of, recipe.blocks)}
    groups = [list(group) for _, group in groupby(sets, key=lambda s: (s.effect, s.design))]
    results, start = [], 0
    for group in groups:
        part = slice(start, start := start + len(group))
        design = designs[group[0].design]
        results += _score_design(design, group, posteriors.subset(part), methods, progress)
    return results


def _score_design(
    design: Design,
    sets: Sequence[BenchmarkSet],
    posteriors: BayesLimit,
    methods: Sequence[Method],
    progress: Progress,
) -> list[PairedResult]:
    """The result of the limit and one of each method, on the sets of one design."""
    limit = _limit_result(design, sets, posteriors)
    results, unavailable = [limit], np.full(len(sets), np.nan)
    tables, total = [one.table for one in sets], len(methods) * len(sets)
    for number, method in enumerate(methods):

        def report(done: int, _: int, before: int = number * len(sets)) -> None:
            progress(limit.description, before + done, total)

        estimates = method.estimate_sets(tables, len(SHEAR), report)
        prior = method.kind is MethodKind.PRIOR
        results.append(
            replace(
                limit,
                method=method.label,
                kind=method.kind,
                inputs=method.inputs,
                estimates=estimates,
                log_densities=np.zeros(len(sets)) if prior else unavailable,
                hpd_levels=unavailable,
            )
        )
    return results


def _limit_result(
    design: Design, sets: Sequence[BenchmarkSet], posteriors: BayesLimit
) -> PairedResult:
    """The exact posterior as a method."""
    effect, quantiles = sets[0].effect, posteriors.quantiles
    estimates = MethodEstimates(
        mean=posteriors.mean,
        covariance=posteriors.covariance,
        interval50=quantiles[:, [1, 2]],
        interval90=quantiles[:, [0, 3]],
        flagged=posteriors.flagged,
        seconds=float("nan"),
    )
    return PairedResult(
        rows=design.rows,
        design=design,
        effect=effect,
        method=POSTERIOR_LABEL if effect else LIMIT_LABEL,
        kind=MethodKind.ANALYTIC if effect else MethodKind.BAYES_LIMIT,
        inputs="slip, load, torque",
        priors=tuple(sets[0].case.prior[n] for n in SHEAR),
        truth=np.stack([one.truth for one in sets]),
        estimates=estimates,
        limit_mean=posteriors.mean,
        log_densities=posteriors.log_densities,
        hpd_levels=posteriors.hpd_levels,
    )
