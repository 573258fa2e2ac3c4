"""Passes of the analysis: covariance, fit of the soil and search in turn, without outliers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.effect_signatures import Signature
from soilml.fitting.least_squares import Solution
from soilml.fitting.predictions import forces, predict
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
from soilml.gap.evidence.outliers import (
    MAX_OUTLIER_FRACTION,
    OUTLIER_SIGMA,
    ends_of_monotone_series,
    many_outliers,
    names_of,
    outliers,
)
from soilml.gap.evidence.problem import (
    FitProblem,
    StartedFit,
    covariance_at,
    fit_many,
    restated,
)
from soilml.gap.evidence.score_test import ScoreTest
from soilml.gap.search.explanation import restated_candidates
from soilml.gap.search.likelier_scatter import with_likelier_scatter
from soilml.gap.search.prediction import Predictions
from soilml.gap.search.residual_test import ResidualTest
from soilml.gap.search.screening import Starts, likeliest_sets
from soilml.gap.search.stepwise import SearchResult, first_look, search, without_search
from soilml.remarks import Remark
from soilml.row_status import Status

#: Passes of covariance, outliers and search; each uses the residuals of the best fit of the last.
MAX_PASSES = 2
#: Searches at most, each without the readings that strayed from the explanation of the last.
OUTLIER_ROUNDS = 4
#: Fits of one explanation at most, to find its outliers before the next search.
SETTLING_FITS = 5
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
    `opened` says which priors of the soil were opened where that matters, which forbids a name.
    `error` is the reason why the data could not be analysed, if they could not.
    """

    problem: FitProblem
    result: SearchResult
    outliers: tuple[str, ...] = ()
    excluded: NDArray[np.bool_] | None = None
    predictions: Predictions = field(default_factory=dict)
    of_all: Analysis | None = None
    opened: Remark | None = None
    error: Remark | None = None


def without_outliers(
    problem: FitProblem,
    seed: int,
    place: Callable[[int], str],
    progress: Callable[[float], None],
    earlier: Analysis | None = None,
    begun: Begun | None = None,
) -> Analysis:
    """The analysis of all readings; without those that no explanation accounts for, if there are.

    A reading is an outlier if it strays from the best explanation of all readings, and from that
    of the readings without it. Each search starts from the explanations of the last; the first one
    from those of an `earlier` analysis, without the readings that it excluded.

    begun: What the first search begins with, where it is known.
    """
    readings = problem.readings
    excluded = np.zeros(len(readings), dtype=np.bool_)
    cleared = excluded
    of_all, last = None, None
    if earlier is not None:
        of_all, last = earlier.of_all, earlier.result
        excluded = excluded if earlier.excluded is None else earlier.excluded
    for left in reversed(range(OUTLIER_ROUNDS)):
        begun = begun or begin(of_readings(problem, ~excluded), seed, place, last)
        found, fit = _search_in_passes(begun, seed, progress)
        begun = None
        of_all, last = of_all or found, found.result
        if found.error:
            return found
        accepted, signatures = last.accepted, last.final_test.signatures
        amplitude = accepted[0].amplitude if accepted else problem.declared_amplitude
        again, cleared = _outliers_of(problem, found.problem, fit, signatures, excluded, cleared)
        if not np.array_equal(again, excluded):
            again, cleared = _settled(problem, fit, amplitude, again, cleared)
        if _are_many(again):
            error = many_outliers(names_of(readings, again, place))
            return Analysis(problem, _no_result(found.result.soil), error=error)
        if not left or np.array_equal(again, excluded):
            break
        excluded = again
    if not excluded.any():
        return found
    names = names_of(readings, excluded, place)
    return replace(found, outliers=names, excluded=excluded, of_all=of_all)


def of_readings(problem: FitProblem, kept: NDArray[np.bool_]) -> FitProblem:
    """The problem of some of its readings, with their declared noise."""
    readings = problem.readings.subset(kept)
    return replace(problem, readings=readings, covariance=declared_covariance(readings))


def _settled(
    problem: FitProblem,
    fit: Solution,
    amplitude: Floats,
    excluded: NDArray[np.bool_],
    cleared: NDArray[np.bool_],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The outliers (m,) of one explanation, fitted to the others in turn until they stay the same.

    The first ones hide others; so found, these need no search of their own. See `_outliers_of`.

    amplitude (channels,): Of the remainder, in usual ones.
    """
    for _ in range(SETTLING_FITS):
        if not excluded.any() or _are_many(excluded):
            break
        own = of_readings(problem, ~excluded)
        (fit,) = restated(own, [fit])
        own = _with_estimated_covariance(own, fit, ())
        whiten = own.discrepancy.whiten(amplitude)
        start = StartedFit(fit.case, fit.coordinates, fit.start_values(), whiten, fit.linearisation)
        (found,) = fit_many(own, [start])
        if isinstance(found, InputError):
            break
        fit = found
        again, cleared = _outliers_of(problem, own, fit, (), excluded, cleared)
        if np.array_equal(again, excluded):
            break
        excluded = again
    return excluded, cleared


def _outliers_of(
    problem: FitProblem,
    own: FitProblem,
    fit: Solution,
    signatures: Sequence[Signature],
    excluded: NDArray[np.bool_],
    cleared: NDArray[np.bool_],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The outliers (m,) among all readings, by a fit to those that were not excluded.

    Each excluded reading is judged alone beside these, for outliers hide each other. One that
    neither strays nor is far is cleared (m,): the fit accounts for it, and it is no outlier from
    then on.

    own: The problem of the readings that were fitted, with their estimated covariance.
    """
    far = np.zeros_like(excluded)
    if excluded.any():
        far[excluded] = _far_from(own, fit, problem.readings.subset(excluded))
        (fit,) = restated(problem, [fit])
        signatures = problem.signatures_beside(fit)
    found = _stray_among(problem, fit, signatures, ~excluded) | far
    for i in np.flatnonzero(excluded & ~far):
        others = ~excluded
        others[i] = True
        found[i] = _stray_among(problem, fit, signatures, others)[i]
    found &= ~cleared
    return found, cleared | (excluded & ~found)


def _stray_among(
    problem: FitProblem, fit: Solution, signatures: Sequence[Signature], kept: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """The readings (m,), of those that are kept, that stray from a fit beside the others kept."""
    if not kept.all():
        problem = of_readings(problem, kept)
        (fit,) = restated(problem, [fit])
        signatures = [replace(s, column=s.column[kept]) for s in signatures]
    found = np.zeros(len(kept), dtype=np.bool_)
    found[kept] = _stray(problem, fit, signatures)
    return found


def _are_many(outliers: NDArray[np.bool_]) -> bool:
    """Whether so many readings are outliers that they form a pattern."""
    return int(np.count_nonzero(outliers)) > MAX_OUTLIER_FRACTION * len(outliers)


#: What a search begins with: the analysis of the soil alone and by single effects, and the
#: explanations of an earlier search, at the readings of this one.
Begun: TypeAlias = tuple[Analysis, Starts]


def begin(
    problem: FitProblem,
    seed: int,
    place: Callable[[int], str],
    earlier: SearchResult | None,
    *,
    likeliest: bool = False,
    only_test: bool = False,
) -> Begun:
    """The covariance and a first look, from the explanations of an `earlier` search.

    likeliest: Look at the likeliest sets of the earlier search too.
    only_test: See `first_look`.
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
        return Analysis(problem, _no_result(soil), error=Remark("no-equilibrium", text)), {}
    best = soil
    if earlier is not None and earlier.accepted:  # it may be one that outliers have moved
        best = min(soil, starts[earlier.accepted[0].names].fit, key=lambda fit: fit.objective)
    problem = _with_estimated_covariance(problem, best, ())
    soil = problem.fit_soil([soil.x], soil.linearisation)
    sets = likeliest_sets(starts) if likeliest else ()
    result = first_look(problem, soil, seed, starts, sets, only_test=only_test)
    return Analysis(problem, result), starts


def _search_in_passes(
    begun: Begun, seed: int, progress: Callable[[float], None]
) -> tuple[Analysis, Solution]:
    """Search and covariance in turn, and the best fit; see `without_outliers`."""
    first, starts = begun
    problem, result = first.problem, first.result
    if first.error:
        return first, result.soil
    result = search(problem, result.soil, seed, starts, _in_pass(0, progress), result)
    for number in range(1, MAX_PASSES):
        if not result.accepted:
            break
        last, best = problem.covariance.components, result.accepted[0].fit
        problem = _with_estimated_covariance(problem, best, result.final_test.signatures)
        if _have_converged(last, problem.covariance.components):
            break
        soil = problem.fit_soil([result.soil.x], result.soil.linearisation)
        starts = {c.names: c for c in result.candidates}
        result = search(problem, soil, seed, starts, _in_pass(number, progress))
    if (scattered := with_likelier_scatter(problem, result)) is not None:
        problem, starts = scattered, {c.names: c for c in result.candidates}
        soil = problem.fit_soil([result.soil.x], result.soil.linearisation)
        result = search(problem, soil, seed, starts)
    return Analysis(problem, result), result.accepted[0].fit if result.accepted else result.soil


def _in_pass(number: int, progress: Callable[[float], None]) -> Callable[[float], None]:
    """A function of the share of one pass that is done."""
    return lambda share: progress((number + share) / MAX_PASSES)


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


def _with_estimated_covariance(
    problem: FitProblem, fit: Solution, signatures: Sequence[Signature]
) -> FitProblem:
    """The problem with the covariance that is estimated from a fit's residuals."""
    readings = problem.readings
    space = _explained_space(problem, fit, signatures)
    residual = readings.measured - fit.prediction
    readings, columns = _with_noise_of_fit(problem, fit, residual, space)
    smooth = smooth_basis_of_few(readings)
    covariance = estimate_covariance(readings, columns, residual, space, smooth)
    return replace(problem, readings=readings, covariance=covariance)


def _explained_space(problem: FitProblem, fit: Solution, signatures: Sequence[Signature]) -> Floats:
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


def _with_noise_of_fit(
    problem: FitProblem, fit: Solution, residual: Floats, space: Floats
) -> tuple[Readings, Floats]:
    """The readings with their noise at a fit, and their changes from run to run, (m, 2).

    Noise that is a fraction of the reading is evaluated at a smoothed prediction.
    """
    case, readings = fit.fitted(), problem.readings
    columns = run_effect_columns(case, readings)
    several_runs = len(readings.runs) > 1
    typical = VarianceComponents.usual(readings)
    smoothing = assemble_covariance(readings, columns if several_runs else 0.0 * columns, typical)
    readings = readings.with_noise_at(fit.prediction + _gls_prediction(smoothing, residual, space))
    return readings.with_noise_of_operation(noise_of_operation(case, readings)), columns


def _stray(
    problem: FitProblem, fit: Solution, signatures: Sequence[Signature]
) -> NDArray[np.bool_]:
    """The readings (m,) that stray from a fit, from what resembles it, and from smooth functions.

    In channels with few readings they stray from both the few smooth functions of a test and the
    larger number that separates rough from smooth. The last reading of a monotone series is none.
    """
    space = _explained_space(problem, fit, signatures)
    residual = problem.readings.measured - fit.prediction
    readings, columns = _with_noise_of_fit(problem, fit, residual, space)
    covariance = assemble_covariance(readings, columns, VarianceComponents.usual(readings))
    replicates = readings.replicates * len(readings.channels) + readings.channel
    run, smooth = readings.run[readings.row], smooth_basis_of_few(readings)
    found = outliers(covariance, residual, space, replicates, run)
    if smooth.shape[1]:
        found &= outliers(covariance, residual, space, replicates, run, smooth)
    return found & ~ends_of_monotone_series(readings)


def _far_from(problem: FitProblem, fit: Solution, readings: Readings) -> NDArray[np.bool_]:
    """The readings (m,) that a fit to others does not predict within a usual remainder."""
    prediction = predict(fit.case, fit.coordinates, fit.x[None, :], readings)[0]
    index = [problem.readings.channels.index(readings.channels[c]) for c in readings.channel]
    usual = problem.discrepancy.process.usual[index]
    std = np.hypot(covariance_at(problem, fit, readings).std, usual)
    far = np.abs(readings.measured - prediction) > OUTLIER_SIGMA * std
    return np.asarray(far | ~np.isfinite(prediction))


def _gls_prediction(covariance: Covariance, residual: Floats, space: Floats) -> Floats:
    """Component of the residuals in a column space, by generalised least squares."""
    white = covariance.whiten @ space
    weights = np.linalg.lstsq(white, covariance.whiten @ residual, rcond=GLS_TOLERANCE)[0]
    return np.asarray(space @ weights)


def _no_result(soil: Solution) -> SearchResult:
    """The result before any search: no candidates, and a test without scores."""
    no_test = ResidualTest((), ScoreTest(np.zeros(0), np.zeros(1), np.zeros(0), np.zeros(0)))
    return without_search(soil, no_test)
