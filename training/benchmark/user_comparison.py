"""Model files and analytic identification on the same test data of the user."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.config.compatibility import (
    effect_differences,
    gear_differences,
    prior_differences,
    recipe_case,
    value_differences,
)
from soilml.errors import InputError
from soilml.identification import METHODS
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.onboard.estimator import Estimator
from soilml.parameters import declared
from soilml.physics.soils import Soil
from soilml.processes import usable_cores
from soilml.quantities import column
from soilml.remarks import Remark
from training.benchmark.methods import Method, analytic_method, model_file_method, prior_method
from training.benchmark.paired_results import MethodResult

Progress = Callable[[str, int, int], None]


#: Most sets of one size that are scored, and how many of these the slower analytic methods get.
MAX_SETS = 2000
ANALYTIC_SETS = 120
#: Wall time, s, that the analytic methods take about where no number of sets is asked for, the
#: sets of each that tell how long one takes, and the fewest that are scored.
ANALYTIC_SECONDS, PILOT, LEAST = 75.0, 4, 8
#: Fewest sets of a size that are scored: the standard error of 90 % coverage is then 7 %.
MIN_SETS = 20


def check_same_provenance(
    case: Case, table: Table, estimators: Mapping[str, Estimator], names: Sequence[str]
) -> list[Remark]:
    """Compare the recipes of test data and estimators with a case.

    Test data and estimators without a recipe are not checked.

    case: The model file.
    table: The test data, with their recipe in its metadata.
    estimators: Estimators by label, each with the recipe of its training data in its metadata.
    names: The parameters compared, whose priors must agree.

    Returns: A note `trained-otherwise` for each difference in soil, effects or prior between the
    case and the training data of an estimator: such an estimator is compared nevertheless.

    Raises `InputError` where the test data differ from the case, or an estimator is of another
    wheel.
    """
    test = recipe_case(table.metadata.get("soilml_recipe", "{}"), table.source)
    trained = {label: recipe_case(e.metadata["recipe"], e.path) for label, e in estimators.items()}
    for label, other in ({table.source: test} | trained).items():
        for difference in gear_differences(case, other) if other else ():
            raise InputError(f"{label} is of {difference}: compare data and models of one wheel")
    for difference in _differences(case, test, names) if test else ():
        raise InputError(
            f"{table.source} has {difference}: use the model file that the data were made with"
        )
    return [
        Remark("trained-otherwise", f"{label} was trained with {difference}", (label,), "note")
        for label, other in trained.items()
        for difference in (_differences(case, other, names) if other else ())
    ]


def _differences(case: Case, other: Case, names: Sequence[str]) -> Iterator[str]:
    yield from effect_differences(case, other)
    yield from value_differences(case, other)
    yield from prior_differences(case, other, names)


class MethodScores(list[MethodResult]):
    """Scores by size of set, then by method, of the parameters `names`."""

    def __init__(self, scores: Iterable[MethodResult], names: Sequence[str]) -> None:
        super().__init__(scores)
        self.names = tuple(names)

    def plot(self, ax: Any = None) -> NDArray[Any]:
        """Draw the RMSE over the prior's standard deviation, and the coverage of 90 % intervals.

        `ax`: axes of matplotlib, two for each of q parameters; a new figure where None. Returns the
        axes, (2, q). Raises `InputError` for another number of axes.
        """
        from training.benchmark.user_report import plot_comparison

        return plot_comparison(self, self.names, ax)


def compare(
    case: Case,
    table: Table,
    estimators: Mapping[str, Estimator],
    progress: Progress = lambda text, done, total: None,
    analytic_sets: int | None = None,
) -> MethodScores:
    """Score the prior, model files and analytic methods on single readings and on whole runs.

    Every method sees the same readings: slip, torque and load; a method that reads more channels
    lists them in `MethodResult.inputs`. Estimates outside the prior are clipped to it, and a failed
    fit counts as the prior's median.

    case: Model, priors and noise that the analytic methods use.
    table: Test data with the true soil in columns; runs of equal length are the sets.
    estimators: Model files by label; all must estimate the same soil parameters.
    progress: Called with a description, the number of estimates done, and their total.
    analytic_sets: Number of sets of each size for the analytic methods; by default at most
        `ANALYTIC_SETS`, and as many as they can do in about `ANALYTIC_SECONDS`.

    Returns: A list of `MethodResult`, by size of set, then by method; its `plot` draws it.

    Raises `InputError` where estimators differ in their parameters, a parameter is not a soil
    parameter, or the table lacks a column of true values.
    """
    first = next(iter(estimators.values()))
    names = first.names
    _check_parameters(estimators)
    ends = zip(names, first.prior.lower, first.prior.upper, strict=True)
    priors = tuple(case.prior.get(n) or Prior(float(low), float(high)) for n, low, high in ends)
    table = _scorable_rows(table, names)
    fast = [prior_method(priors)]
    for label, estimator in estimators.items():
        fast.append(model_file_method(label, estimator))
    # the quickest first: what they leave of the time is for the others
    order = sorted(METHODS, key=lambda name: name in ("averaged", "posterior"))
    slow = [analytic_method(case, name, names) for name in order]
    scores = []

    def score(
        method: Method,
        sets: Sequence[Table],
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> None:
        estimates = method.estimate_sets(sets, len(names), progress)
        result = MethodResult(
            rows=len(sets[0]),
            method=method.label,
            kind=method.kind,
            inputs=method.inputs,
            priors=priors,
            truth=np.asarray([[s[column(n)][0] for n in names] for s in sets]),
            estimates=estimates,
        )
        scores.append(result)

    by_size = _sets_by_size(table)
    for size, sets in by_size.items():
        for method in fast:
            score(method, sets, partial(progress, f"{method.label}, {size} rows"))
    jobs = [
        (method, size)
        for method in slow
        for size, sets in by_size.items()
        if all(column(c) in sets[0] for c in method.channels)
    ]
    started = time.monotonic()
    for number, (method, size) in enumerate(jobs):
        sets, count = by_size[size], analytic_sets
        if count is None:
            left = ANALYTIC_SECONDS - (time.monotonic() - started)
            count = _affordable(method, sets, len(names), left / (len(jobs) - number))
        fewer = sets[:: max(len(sets) // count, 1)][:count]
        score(method, fewer, partial(progress, f"{method.label}, {size} rows"))
    labels = [method.label for method in (*fast, *slow)]
    scores.sort(key=lambda one: (one.rows, labels.index(one.method)))
    return MethodScores(scores, names)


def _affordable(method: Method, sets: Sequence[Table], q: int, seconds: float) -> int:
    """How many sets a method can estimate in a time, s, by the time of the first."""
    each = float(np.mean(method.estimate_sets(sets[:PILOT], q).seconds)) / usable_cores()
    return int(np.clip(seconds / max(each, 1e-6) - PILOT, LEAST, ANALYTIC_SETS))


def _check_parameters(estimators: Mapping[str, Estimator]) -> None:
    first = next(iter(estimators.values()))
    for label, estimator in estimators.items():
        if estimator.names != first.names:
            raise InputError(
                f"{label} estimates {', '.join(estimator.names)}, but {first.path} estimates "
                f"{', '.join(first.names)}: compare files of the same parameters"
            )
    for name in first.names:
        if name not in declared(Soil):
            raise InputError(
                f"{first.path} estimates {name}, which no analytic method identifies; compare "
                f"needs estimators of {', '.join(declared(Soil))}"
            )


def _scorable_rows(table: Table, names: Sequence[str]) -> Table:
    """Rows with a torque and an equilibrium; raises `InputError` without true values."""
    for name in names:
        if column(name) not in table:
            raise InputError(
                f"{table.source}: column {column(name)} is missing: no truth to score against"
            )
    return table.rows(np.isfinite(table["torque_Nm"]) & table.answered)


def _sets_by_size(table: Table) -> dict[int, list[Table]]:
    """Sets by size: single rows, one of each run, and all runs of a length that is frequent."""
    runs = [rows for _, rows in table.groups("run")]
    step = max(len(runs) // MAX_SETS, 1)
    sets = {1: [rows.rows(np.asarray([i % len(rows)])) for i, rows in enumerate(runs[::step])]}
    for size in sorted({len(rows) for rows in runs} - {1}):
        equal = [rows for rows in runs if len(rows) == size][:MAX_SETS]
        if len(equal) >= MIN_SETS:
            sets[size] = equal
    return sets
