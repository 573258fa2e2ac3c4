"""Passes of the analysis: covariance, fit of the soil and search in turn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.effect_signatures import Signature
from soilml.fitting.least_squares import Solution
from soilml.fitting.predictions import forces
from soilml.fitting.readings import Readings
from soilml.gap.evidence.covariance import (
    RUN_EFFECT_UNITS,
    Covariance,
    VarianceComponents,
    assemble_covariance,
    estimate_covariance,
    run_effect_columns,
)
from soilml.gap.evidence.directions import smooth_basis, smooth_basis_of_few
from soilml.gap.evidence.problem import FitProblem, restated
from soilml.gap.evidence.score_test import ScoreTest
from soilml.gap.search.explanation import restated_candidates
from soilml.gap.search.likelier_scatter import with_likelier_scatter
from soilml.gap.search.prediction import Predictions
from soilml.gap.search.residual_test import ResidualTest
from soilml.gap.search.screening import Singles, Starts, likeliest_sets
from soilml.gap.search.stepwise import (
    SearchResult,
    first_look,
    look_further,
    search,
    without_search,
)
from soilml.remarks import Remark
from soilml.row_status import Status

#: Starts of the fit of the soil, as fractions of each prior, besides the case's own values.
SOIL_STARTS = (0.5, 0.25)
#: Variance components have converged when noise scales differ by less than this fraction and the
#: run-to-run standard deviations by less than this many units: weights of the readings then differ
#: by less than their estimation error.
SCALE_TOLERANCE, RUN_EFFECT_TOLERANCE = 0.2, 0.3
#: Singular values below this fraction of the largest are ignored in the generalised least squares
#: fit that smooths the noise: its columns are nearly collinear, and only their span matters.
GLS_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Analysis:
    """The final fit problem, the result of the search on it, and the excluded outliers.

    `predictions` are those of rows kept back, by the soil alone and the likeliest explanations.
    `of_all` is the analysis of all readings, where some were excluded.
    `excluded` (m,) are the readings of `outliers` among all.
    `opened` says which priors of the soil were opened where that matters, which forbids a name;
    `within_priors` is then the fit of the soil alone within those of the case.
    `error` is the reason why the data could not be analysed, if they could not.
    """

    problem: FitProblem
    result: SearchResult
    outliers: tuple[str, ...] = ()
    excluded: NDArray[np.bool_] | None = None
    predictions: Predictions = field(default_factory=dict)
    of_all: Analysis | None = None
    opened: Remark | None = None
    within_priors: Solution | None = None
    error: Remark | None = None


def of_readings(problem: FitProblem, kept: NDArray[np.bool_]) -> FitProblem:
    """The problem of some of its readings, with their declared noise."""
    readings = problem.readings.subset(kept)
    return replace(problem, readings=readings, covariance=declared_covariance(readings))


#: What a search begins with: the analysis of the soil alone and by single effects, and the
#: explanations of an earlier search, at the readings of this one.
Begun: TypeAlias = tuple[Analysis, Starts]


def begin(
    problem: FitProblem,
    seed: int,
    place: Callable[[int], str],
    earlier: SearchResult | None,
    explained: Solution | None = None,
    *,
    likeliest: bool = False,
    singles: Singles = "all",
) -> Begun:
    """The covariance and a first look, from the explanations of an `earlier` search.

    explained: The fit that the covariance is estimated from; else it is the best of the soil alone
        and of the earlier search.
    likeliest: Look at the likeliest sets of the earlier search too.
    singles: See `first_look`.
    """
    free, starts = problem.soil, restated_candidates(problem, earlier.candidates if earlier else ())
    first = np.asarray([f.prior.fraction(f.nominal) for f in free])
    if earlier is not None:
        first = restated(problem, [earlier.soil])[0].x
    soil = problem.fit_soil([first, *(np.full(len(free), x) for x in SOIL_STARTS)])
    infeasible = np.flatnonzero(~np.isfinite(soil.prediction))
    if infeasible.size:
        row = int(problem.readings.row[infeasible[0]])
        status = Status(int(forces(soil.fitted(), problem.readings.at).status[row]))
        text = f"the model cannot carry the load of {place(row)}"
        if status not in (Status.TOO_HEAVY, Status.NOT_CONVERGED):
            text = f"{place(row)}: {status.reason}"
        return Analysis(problem, no_result(soil), error=Remark("no-equilibrium", text)), {}
    best: Solution = soil
    signatures: Sequence[Signature] = ()
    if explained is not None:
        (best,) = restated(problem, [explained])
    elif earlier is not None and earlier.accepted:  # it may be one that outliers have moved
        best = min(soil, starts[earlier.accepted[0].names].fit, key=lambda fit: fit.objective)
        if best is not soil:
            signatures = earlier.final_test.signatures
    problem = with_estimated_covariance(problem, best, signatures)
    soil = problem.fit_soil([soil.x], soil.linearisation)
    sets = likeliest_sets(starts) if likeliest else ()
    without_gain = frozenset[str]()
    if earlier is not None and tuple(earlier.soil.coordinates) == problem.soil:
        without_gain = frozenset(earlier.without_gain)
    result = first_look(
        problem, soil, seed, starts, sets, singles=singles, without_gain=without_gain
    )
    return Analysis(problem, result), starts


def with_singles(begun: Begun, seed: int) -> Begun:
    """The same look with all likely single effects."""
    first, starts = begun
    result = look_further(first.problem, first.result, seed, starts)
    return replace(first, result=result), starts


def search_in_passes(begun: Begun, seed: int, progress: Callable[[float], None]) -> Analysis:
    """The search, with the covariance that is estimated from what its best explanation leaves.

    Where that by the first look differs, the look is repeated with it before larger sets are
    fitted; where that by a larger set does, the search is.
    """
    first, starts = begun
    problem, look = first.problem, first.result
    new, same = _with_covariance_of(problem, look)
    if not same:
        again, starts = _looked_again(new, look, seed)
        problem, look = new, again.result
    result = search(problem, look.soil, seed, starts, lambda x: progress(0.5 * x), look)
    if result.best is not look.best:
        new, same = _with_covariance_of(problem, result)
        if not same:
            result = _search_again(new, result, seed, lambda x: progress(0.5 + 0.5 * x))
    if (scattered := with_likelier_scatter(new, result)) is not None:
        new, result = scattered, _search_again(scattered, result, seed)
    return Analysis(new, result)


def _with_covariance_of(problem: FitProblem, result: SearchResult) -> tuple[FitProblem, bool]:
    """The problem with the covariance by the best explanation, and whether that is nearly its own.

    Without an explanation, it is the problem itself.
    """
    if not result.accepted:
        return problem, True
    new = with_estimated_covariance(problem, result.best, result.final_test.signatures)
    return new, _have_converged(problem.covariance.components, new.covariance.components)


def _looked_again(problem: FitProblem, result: SearchResult, seed: int) -> Begun:
    """A first look with another covariance, from the explanations of a search."""
    soil = problem.fit_soil([result.soil.x], result.soil.linearisation)
    starts = {c.names: c for c in result.candidates}
    return Analysis(
        problem, first_look(problem, soil, seed, starts, without_gain=result.without_gain)
    ), starts


def _search_again(
    problem: FitProblem,
    result: SearchResult,
    seed: int,
    progress: Callable[[float], None] = lambda _: None,
) -> SearchResult:
    """The search with another covariance, from the explanations of the last."""
    look, starts = _looked_again(problem, result, seed)
    return search(problem, look.result.soil, seed, starts, progress, look.result)


def declared_covariance(readings: Readings) -> Covariance:
    """The declared noise alone."""
    components = VarianceComponents.usual(readings, units=0.0)
    return assemble_covariance(readings, np.zeros((len(readings), 2)), components)


def _have_converged(last: VarianceComponents, new: VarianceComponents) -> bool:
    """Whether two estimates of the variance components weight the readings nearly equally."""
    angle = abs(last.friction_angle_std - new.friction_angle_std)
    bearing = abs(last.bearing_std - new.bearing_std)
    return (
        bool(np.all(np.abs(last.noise_scale / new.noise_scale - 1.0) < SCALE_TOLERANCE))
        and last.autocorrelation == new.autocorrelation
        and angle < RUN_EFFECT_TOLERANCE * RUN_EFFECT_UNITS["friction_angle"]
        and bearing < RUN_EFFECT_TOLERANCE * RUN_EFFECT_UNITS["bearing"]
    )


def with_estimated_covariance(
    problem: FitProblem, fit: Solution, signatures: Sequence[Signature]
) -> FitProblem:
    """The problem with the covariance that is estimated from a fit's residuals."""
    readings = problem.readings
    space = explained_space(problem, fit, signatures)
    residual = readings.measured - fit.prediction
    readings, columns = with_noise_of_fit(problem, fit, residual, space)
    smooth = smooth_basis_of_few(readings)
    covariance = estimate_covariance(readings, columns, residual, space, smooth)
    return replace(problem, readings=readings, covariance=covariance)


def explained_space(problem: FitProblem, fit: Solution, signatures: Sequence[Signature]) -> Floats:
    """All that soil, effects and smooth functions could explain, (m, q)."""
    readings = problem.readings
    if not signatures or len(signatures[0].column) != len(readings):
        signatures = problem.signatures_beside(fit)
    declared = problem.declared_amplitude[problem.discrepancy.process.channel] > 0.0
    return np.column_stack(
        [
            fit.derivatives,
            *[s.column for s in signatures],
            smooth_basis(readings),
            problem.discrepancy.process.columns[:, declared],
        ]
    )


def with_noise_of_fit(
    problem: FitProblem, fit: Solution, residual: Floats, space: Floats
) -> tuple[Readings, Floats]:
    """The readings with their noise at a fit, and their changes from run to run, (m, 2)."""
    case, readings = fit.fitted(), problem.readings
    columns, operation = run_effect_columns(case, readings), noise_of_operation(case, readings)
    noisy = with_smoothed_noise(readings, fit.prediction, residual, space, columns, operation)
    return noisy, columns


def with_smoothed_noise(
    readings: Readings,
    prediction: Floats,
    residual: Floats,
    space: Floats,
    columns: Floats,
    operation: Floats,
) -> Readings:
    """The readings with their noise at a smoothed prediction (m,), and that of slip and load (m,).

    The prediction is smoothed by the part of the residuals that lies in the space (m, q). Noise
    that is a fraction of the reading is that fraction of it.

    columns (m, 2): Changes from run to run.
    operation (m,): Noise by that of slip and load.
    """
    several_runs = len(readings.runs) > 1
    typical = VarianceComponents.usual(readings)
    smoothing = assemble_covariance(readings, columns if several_runs else 0.0 * columns, typical)
    readings = readings.with_noise_at(prediction + _gls_prediction(smoothing, residual, space))
    return readings.with_noise_of_operation(operation)


def _gls_prediction(covariance: Covariance, residual: Floats, space: Floats) -> Floats:
    """Component of the residuals in a column space, by generalised least squares."""
    white = covariance.whiten @ space
    weights = np.linalg.lstsq(white, covariance.whiten @ residual, rcond=GLS_TOLERANCE)[0]
    return np.asarray(space @ weights)


def no_result(soil: Solution) -> SearchResult:
    """The result before any search: no candidates, and a test without scores."""
    no_test = ResidualTest((), ScoreTest(np.zeros(0), np.zeros(1), np.zeros(0), np.zeros(0)))
    return without_search(soil, no_test)
