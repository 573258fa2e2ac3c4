"""The fixed benchmark: every method on the same sets, beside the Bayes limit of those sets."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby

import numpy as np

from datagen.recipe import Recipe, read_recipe
from soilml.errors import InputError
from soilml.identification import METHODS
from soilml.onboard.estimator import Estimator
from soilml.quantities import SHEAR
from training.benchmark.bayes_limit import FRACTIONS, Job, jobs
from training.benchmark.bayes_limit_file import BayesLimit, load, shipped
from training.benchmark.designs import Design, design_of
from training.benchmark.methods import (
    ANALYTIC,
    PRIOR,
    Method,
    MethodAnswers,
    Own,
    analytic,
    own_methods,
    prior_alone,
    trained,
)
from training.benchmark.paired_results import Result

Progress = Callable[[str, int, int], None]

#: The recipe whose sets these are; it comes with the package.
RECIPE = "benchmark"
#: The line of the limit; with an effect that its model lacks, it is but the posterior method.
LIMIT, POSTERIOR = "Bayes limit", f"{ANALYTIC}posterior"
#: Analytic methods that are asked; the exact posterior is the limit itself.
ASKED = tuple(name for name in METHODS if name != "posterior")


def methods(
    recipe: Recipe,
    estimators: Mapping[str, Estimator] | None = None,
    own: Mapping[str, Own] | None = None,
    named: Sequence[str] = ASKED,
) -> list[Method]:
    """The prior, model files, functions of one's own (see `Own`) and analytic methods by name."""
    for label, estimator in (estimators or {}).items():
        if estimator.names != SHEAR:
            raise InputError(
                f"{label} estimates {', '.join(estimator.names)}; the benchmark is for "
                f"{', '.join(SHEAR)}"
            )
    found = [prior_alone([recipe.case.prior[n] for n in SHEAR])]
    for label, estimator in (estimators or {}).items():
        found += trained(label, estimator)
    found += own_methods(own or {})
    return found + [analytic(recipe.case, name, SHEAR) for name in named]


def benchmark(
    estimators: Mapping[str, Estimator] | None = None,
    own: Mapping[str, Own] | None = None,
    most: int | None = None,
    limit: str | os.PathLike[str] | None = None,
    progress: Progress = lambda text, done, total: None,
    named: Sequence[str] = ASKED,
) -> list[Result]:
    """Every method on every design, without and with effects that none of them knows.

    `named` are the analytic methods. `most` sets of each design are used, all where it is None.
    `limit` is a file of `soilml compare --limit`, else the one that comes with the package. Raises
    `InputError` where it is not of these rows.
    """
    recipe = read_recipe(RECIPE)
    asked = methods(recipe, estimators, own, named)
    wanted = jobs(recipe, SHEAR, most)
    known = load(limit or shipped(), wanted)
    designs = {design.key: design for design in map(design_of, recipe.blocks)}
    groups = [list(same) for _, same in groupby(wanted, key=lambda j: (j.effect, j.design))]
    found, start = [], 0
    for group in groups:
        part = slice(start, start := start + len(group))
        found += _scored(designs[group[0].design], group, known.rows(part), asked, progress)
    return found


def _scored(
    design: Design,
    group: Sequence[Job],
    known: BayesLimit,
    asked: Sequence[Method],
    progress: Progress,
) -> list[Result]:
    """A line for the limit and one for each method, on the sets of one design."""
    low, first, third, high = (known.quantiles[:, i] for i in range(len(FRACTIONS)))
    inner, outer = np.stack([first, third], axis=1), np.stack([low, high], axis=1)
    least = MethodAnswers(known.mean, known.covariance, inner, outer, known.flagged, float("nan"))
    limit = Result(
        design=design,
        effect=group[0].effect,
        method=POSTERIOR if group[0].effect else LIMIT,
        inputs="slip, load, torque",
        priors=tuple(group[0].case.prior[n] for n in SHEAR),
        truth=np.stack([job.truth for job in group]),
        answers=least,
        limit=known.mean,
        density=known.density,
        denser=known.denser,
    )
    found, unknown = [limit], np.full(len(group), np.nan)
    tables, total = [job.table for job in group], len(asked) * len(group)
    for method in asked:
        before = (len(found) - 1) * len(group)
        told = partial(_told, progress, limit.driven, before, total)
        answers = method.answers(tables, len(SHEAR), told)
        density = np.zeros(len(group)) if method.name == PRIOR else unknown
        line = replace(limit, method=method.name, inputs=method.inputs)
        found.append(replace(line, answers=answers, density=density, denser=unknown))
    return found


def _told(progress: Progress, text: str, before: int, total: int, done: int, sets: int) -> None:
    """One bar for all methods on a design."""
    progress(text, before + done, total)
