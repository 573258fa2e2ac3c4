"""Model files and analytic identification on the same sets, whose soil is known."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from datagen.recipe import Recipe
from datagen.simulation import block_sizes, simulate_rows
from soilml.arrays import Floats
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
from soilml.quantities import column
from soilml.remarks import Remark
from training.benchmark.methods import (
    LIMIT,
    Method,
    analytic_method,
    model_file_method,
    prior_method,
)

Progress = Callable[[str, int, int], None]

#: Most sets of one design that are scored, and how many of these the slower analytic methods get.
MAX_SETS, ANALYTIC_SETS = 2000, 120
ANALYTIC_SECONDS = 75.0  # Wall time that the analytic methods take about
#: Fewest sets of a design that are scored: the standard error of 90 % coverage is then 7 %.
MIN_SETS = 20
#: Loads of a set that spread by less than this share of their mean count as one load.
ONE_LOAD = 0.1


@dataclass(frozen=True)
class MethodResult:
    """Estimates of a method, with the true values of the same n sets of one design.

    Estimates outside the prior are clipped to it, and a failed one counts as its median. Figures of
    parameters that the method does not estimate are NaN.
    """

    rows: int  # Readings of a set
    one_load: bool  # Whether all of a set are under one load
    method: Method
    priors: tuple[Prior, ...]
    truth: Floats  # (n, q) SI units
    estimates: Floats  # (n, 3, q) as `Method.estimate`
    seconds: float  # Mean wall time of an estimate
    limit_error: Floats | None = None  # (m, q) of the Bayes limit on the first m of the design

    @property
    def design(self) -> str:
        """In words."""
        loads = "one load" if self.one_load else "several loads"
        return "1 reading" if self.rows == 1 else f"{self.rows} readings of one soil, {loads}"

    @property
    def not_estimated(self) -> NDArray[np.bool_]:
        """Parameters (q,) that the method does not estimate."""
        return np.asarray(~np.isfinite(self.estimates[:, 0]).any(axis=0))

    @property
    def failed(self) -> int:
        """Number of sets without an estimate."""
        answered = np.isfinite(self.estimates[:, 0][:, ~self.not_estimated])
        return int((~answered).any(axis=1).sum()) if answered.shape[1] else len(self.truth)

    @property
    def error(self) -> Floats:
        """Estimate less truth (n, q), SI units."""
        ends = np.asarray([(p.lower, float(p.at(np.asarray(0.5))), p.upper) for p in self.priors]).T
        mean = self.estimates[:, 0]
        value = np.where(np.isfinite(mean), np.clip(mean, ends[0], ends[2]), ends[1])
        return np.where(self.not_estimated, np.nan, value - self.truth)

    @property
    def rmse(self) -> Floats:
        """Root mean squared error (q,), SI units."""
        return np.asarray(np.sqrt(np.mean(self.error**2, axis=0)))

    @property
    def rmse_over_prior(self) -> Floats:
        """RMSE (q,) over the prior's standard deviation."""
        return np.asarray(self.rmse / [p.std for p in self.priors])

    @property
    def coverage(self) -> Floats:
        """Coverage (q,) of the method's 90 % intervals, of the sets answered."""
        ends = self.estimates[:, 1:]
        finite = np.isfinite(ends).all(axis=1)
        inside = (self.truth >= ends[:, 0]) & (self.truth <= ends[:, 1]) & finite
        count = finite.sum(axis=0)
        return np.where(count > 0, inside.sum(axis=0) / np.maximum(count, 1), np.nan)

    @property
    def over_limit(self) -> tuple[Floats, Floats]:
        r"""RMSE (q,) over that of the Bayes limit on the same sets, and its standard error.

        The mean of the exact posterior has the least expected squared error. The jackknife over
        sets, with r_(i) the ratio without set i,

        .. math:: \sigma^2 = \frac{n - 1}{n} \sum_i (r_{(i)} - \bar{r})^2

        is smaller than the standard error of either RMSE, because both errors are correlated
        (Efron and Stein, Annals of Statistics 9, 1981). NaN where the limit was not computed.
        """
        if self.limit_error is None:
            return np.full(len(self.priors), np.nan), np.full(len(self.priors), np.nan)
        both = min(len(self.truth), len(self.limit_error))
        own, limit = self.error[:both] ** 2, self.limit_error[:both] ** 2
        without = np.sqrt((own.sum(axis=0) - own) / (limit.sum(axis=0) - limit))
        error = np.sqrt((len(own) - 1) * np.mean((without - without.mean(axis=0)) ** 2, axis=0))
        return np.sqrt(own.sum(axis=0) / limit.sum(axis=0)), error


def check_same_provenance(
    case: Case, table: Table, estimators: Mapping[str, Estimator], names: Sequence[str]
) -> list[Remark]:
    """Compare the recipes of test data and estimators with a case.

    Test data and estimators without a recipe are not checked.

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


def sets_of_recipe(recipe: Recipe) -> list[Table]:
    """The simulated sets of a recipe: all runs of every block, without a file."""
    sets = []
    for number, (block, size) in enumerate(zip(recipe.blocks, block_sizes(recipe), strict=True)):
        table = Table(simulate_rows(recipe, number, 0, size - size % block.rows), "the benchmark")
        sets += [table.rows(rows) for rows in np.arange(len(table)).reshape(-1, block.rows)]
    return sets


def sets_of_table(table: Table, names: Sequence[str]) -> list[Table]:
    """The runs of test data, and a row of each; raises `InputError` without true values."""
    for name in names:
        if column(name) not in table:
            raise InputError(
                f"{table.source}: column {column(name)} is missing: no truth to score against"
            )
    rows = table.rows(np.isfinite(table["torque_Nm"]) & table.answered)
    runs = [run for _, run in rows.groups("run")]
    step = max(len(runs) // MAX_SETS, 1)
    single = [run.rows(np.asarray([i % len(run)])) for i, run in enumerate(runs[::step])]
    return single + [run for run in runs if len(run) > 1]


def compare(
    case: Case,
    sets: Sequence[Table],
    estimators: Mapping[str, Estimator],
    progress: Progress = lambda text, done, total: None,
    most_sets: int = MAX_SETS,
) -> list[MethodResult]:
    """Score the prior, model files and analytic methods on sets of readings.

    Every method sees the same readings: slip, torque and load; a method that reads more channels
    lists them in `Method.inputs`.

    case: Model, priors and noise that the analytic methods use.
    sets: Rows of one soil each, with the true soil in columns; those of one size, at one load or at
        several, are a design. A design of fewer than `MIN_SETS` sets is left out.
    estimators: Model files by label; all must estimate the same soil parameters.
    progress: Called with a description, the number of estimates done, and their total.
    most_sets: Most sets of a design. Analytic methods get `ANALYTIC_SETS` at most, and as many as
        they can do in about `ANALYTIC_SECONDS`.

    Returns: The results by design, then by method.

    Raises `InputError` where estimators differ in their parameters, or a parameter is not one of
    the soil.
    """
    first = next(iter(estimators.values()))
    names = first.names
    for label, estimator in estimators.items():
        if estimator.names != names:
            raise InputError(
                f"{label} estimates {', '.join(estimator.names)}, but {first.path} estimates "
                f"{', '.join(names)}: compare files of the same parameters"
            )
    if wrong := [name for name in names if name not in declared(Soil)]:
        raise InputError(
            f"{first.path} estimates {wrong[0]}, which no analytic method identifies; compare "
            f"needs estimators of {', '.join(declared(Soil))}"
        )
    ends = zip(names, first.prior.lower, first.prior.upper, strict=True)
    priors = tuple(case.prior.get(n) or Prior(float(low), float(high)) for n, low, high in ends)
    designs = _designs(sets, most_sets)
    fast = [prior_method(priors), *(model_file_method(n, e) for n, e in estimators.items())]
    # the quickest first: what they leave of the time is for the others
    order = sorted(METHODS, key=lambda name: name in ("averaged", "posterior"))
    slow = [analytic_method(case, name, names) for name in order]
    results: list[MethodResult] = []

    def score(method: Method, design: tuple[int, bool], most: int, seconds: float) -> None:
        own = designs[design][:most]
        report = partial(progress, f"{method.label}, {design[0]} rows")
        estimates, each = method.estimate_sets(own, len(names), report, seconds)
        truth = np.asarray([[s[column(n)][0] for n in names] for s in own[: len(estimates)]])
        results.append(MethodResult(*design, method, priors, truth, estimates, each))

    for design in designs:
        for method in fast:
            score(method, design, most_sets, np.inf)
    jobs = [
        (method, design)
        for method in slow
        for design, own in designs.items()
        if all(column(c) in own[0] for c in method.channels)
    ]
    ends_at = time.monotonic() + ANALYTIC_SECONDS
    for number, (method, design) in enumerate(jobs):
        share = (ends_at - time.monotonic()) / (len(jobs) - number)
        score(method, design, ANALYTIC_SETS, share)
    limits = {(r.rows, r.one_load): r.error for r in results if r.method.label == LIMIT}
    labels = [method.label for method in (*fast, *slow)]
    results.sort(key=lambda r: (r.rows, not r.one_load, labels.index(r.method.label)))
    return [replace(r, limit_error=limits.get((r.rows, r.one_load))) for r in results]


def _designs(sets: Sequence[Table], most: int) -> dict[tuple[int, bool], list[Table]]:
    """Sets by their number of rows and whether these are under one load."""
    found: dict[tuple[int, bool], list[Table]] = {}
    for one in sets:
        one_load = bool(np.ptp(one["load_N"]) <= ONE_LOAD * np.mean(one["load_N"]))
        found.setdefault((len(one), one_load), []).append(one)
    enough = min(MIN_SETS, most)
    return {key: found[key][:most] for key in sorted(found) if len(found[key]) >= enough}
