"""The analysis without outliers: searches in turn, each without the readings that strayed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.effect_signatures import Signature
from soilml.fitting.least_squares import Solution
from soilml.fitting.predictions import predict
from soilml.fitting.readings import Readings
from soilml.gap.evidence.covariance import (
    VarianceComponents,
    assemble_covariance,
    run_effect_columns,
)
from soilml.gap.evidence.directions import smooth_basis_of_few
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
from soilml.gap.search.passes import (
    Analysis,
    Begun,
    begin,
    explained_space,
    no_result,
    of_readings,
    search_in_passes,
    with_estimated_covariance,
    with_smoothed_noise,
)
from soilml.gap.search.screening import Starts
from soilml.gap.search.stepwise import SearchResult, search

#: Searches at most, each without the readings that strayed from the explanation of the last.
OUTLIER_ROUNDS = 4
#: Fits of one explanation at most, to find its outliers before the next search.
SETTLING_FITS = 5


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
    from those of an `earlier` analysis, without the readings that it excluded. Only the one that
    leaves no other outliers goes on with a covariance of its own; see `search_in_passes`.

    begun: What the first search begins with, where it is known.
    """
    readings = problem.readings
    excluded = np.zeros(len(readings), dtype=np.bool_)
    cleared = excluded
    of_all, last, settled = None, None, None
    if earlier is not None:
        of_all, last = earlier.of_all, earlier.result
        excluded = excluded if earlier.excluded is None else earlier.excluded
    for left in reversed(range(OUTLIER_ROUNDS)):
        own = of_readings(problem, ~excluded)
        found, starts = begun or begin(own, seed, place, last, settled)
        begun = None
        if found.error:
            return found
        again, judged = excluded, None
        if left:
            if (_outliers_beside(problem, found, excluded, cleared)[0] & ~excluded).any():
                found = _with_larger_sets(found, starts, seed)  # they may account for these
                again, cleared, settled = _judged(problem, found, excluded, cleared, further=True)
            judged = found.result.best
        if np.array_equal(again, excluded):
            found = search_in_passes((found, starts), seed, progress)
            if excluded.any() or found.result.best is not judged:
                again, cleared, settled = _judged(problem, found, excluded, cleared)
        of_all, last = of_all or found, found.result
        if _are_many(again):
            error = many_outliers(names_of(readings, again, place))
            return Analysis(problem, no_result(last.soil), error=error)
        if not left or np.array_equal(again, excluded):
            break
        excluded = again
    if not excluded.any():
        return found
    names = names_of(readings, excluded, place)
    return replace(found, outliers=names, excluded=excluded, of_all=of_all)


def _with_larger_sets(found: Analysis, starts: Starts, seed: int) -> Analysis:
    """A first look with the larger sets of its search, under the same covariance."""
    result = found.result
    return replace(found, result=search(found.problem, result.soil, seed, starts, begun=result))


def _judged(
    problem: FitProblem,
    found: Analysis,
    excluded: NDArray[np.bool_],
    cleared: NDArray[np.bool_],
    *,
    further: bool = False,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Solution | None]:
    """The outliers (m,) by an analysis; where they are others than before, settled.

    further: Judge no reading that is excluded already.
    """
    again, now_cleared = _outliers_beside(problem, found, excluded, cleared)
    if further:
        again, now_cleared = again | excluded, cleared
    if np.array_equal(again, excluded):
        return again, now_cleared, None
    return _settled(problem, found.result, again, now_cleared)


def _outliers_beside(
    problem: FitProblem,
    found: Analysis,
    excluded: NDArray[np.bool_],
    cleared: NDArray[np.bool_],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The outliers (m,) by the best explanation of an analysis; see `_outliers_of`."""
    fit, signatures = found.result.best, found.result.final_test.signatures
    return _outliers_of(problem, found.problem, fit, signatures, excluded, cleared)


def _settled(
    problem: FitProblem,
    result: SearchResult,
    excluded: NDArray[np.bool_],
    cleared: NDArray[np.bool_],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Solution]:
    """The outliers (m,) of one explanation, fitted to the others in turn until they stay the same.

    The first ones hide others; so found, these need no search of their own. Besides what
    `_outliers_of` returns, the last fit.

    result: That of the search which found the explanation.
    """
    fit, amplitude = result.best, problem.declared_amplitude
    if result.accepted:
        amplitude = result.accepted[0].amplitude
    signatures: Sequence[Signature] = result.final_test.signatures  # fits differ little
    if len(fit.measured) != len(problem.readings):
        signatures = problem.signatures_beside(*restated(problem, [fit]))
    for _ in range(SETTLING_FITS):
        if not excluded.any() or _are_many(excluded):
            break
        own = of_readings(problem, ~excluded)
        (fit,) = restated(own, [fit])
        own = with_estimated_covariance(own, fit, _of_some(signatures, ~excluded))
        whiten = own.discrepancy.whiten(amplitude)
        start = StartedFit(fit.case, fit.coordinates, fit.start_values(), whiten, fit.linearisation)
        (found,) = fit_many(own, [start])
        if isinstance(found, InputError):
            break
        fit = found
        again, cleared = _outliers_of(problem, own, fit, signatures, excluded, cleared)
        if np.array_equal(again, excluded):
            break
        excluded = again
    return excluded, cleared, fit


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
    stray = _strays_from(problem, fit, signatures)
    found = stray(~excluded) | far
    for i in np.flatnonzero(excluded & ~far):
        others = ~excluded
        others[i] = True
        found[i] = stray(others)[i]
    found &= ~cleared
    return found, cleared | (excluded & ~found)


def _of_some(signatures: Sequence[Signature], kept: NDArray[np.bool_]) -> list[Signature]:
    """The signatures at some of the readings."""
    return [replace(s, column=s.column[kept]) for s in signatures]


def _are_many(outliers: NDArray[np.bool_]) -> bool:
    """Whether so many readings are outliers that they form a pattern."""
    return int(np.count_nonzero(outliers)) > MAX_OUTLIER_FRACTION * len(outliers)


def _strays_from(
    problem: FitProblem, fit: Solution, signatures: Sequence[Signature]
) -> Callable[[NDArray[np.bool_]], NDArray[np.bool_]]:
    """Which readings (m,), of those that are kept, stray from a fit beside the others kept (m,).

    They stray from what resembles it and from smooth functions too. In channels with few readings
    they stray from both the few smooth functions of a test and the larger number that separates
    rough from smooth. The last reading of a monotone series is none.
    """
    case, every = fit.fitted(), problem.readings
    space = explained_space(problem, fit, signatures)
    of_runs, operation = run_effect_columns(case, every), noise_of_operation(case, every)

    def stray(kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
        own, columns, explained = every.subset(kept), of_runs[kept], space[kept]
        prediction = fit.prediction[kept]
        residual = own.measured - prediction
        own = with_smoothed_noise(own, prediction, residual, explained, columns, operation[kept])
        covariance = assemble_covariance(own, columns, VarianceComponents.usual(own))
        replicates = own.replicates * len(own.channels) + own.channel
        run, smooth = own.run[own.row], smooth_basis_of_few(own)
        found = outliers(covariance, residual, explained, replicates, run)
        if smooth.shape[1]:
            found &= outliers(covariance, residual, explained, replicates, run, smooth)
        among = np.zeros(len(kept), dtype=np.bool_)
        among[kept] = found & ~ends_of_monotone_series(own)
        return among

    return stray


def _far_from(problem: FitProblem, fit: Solution, readings: Readings) -> NDArray[np.bool_]:
    """The readings (m,) that a fit to others does not predict within a usual remainder."""
    prediction = predict(fit.case, fit.coordinates, fit.x[None, :], readings)[0]
    index = [problem.readings.channels.index(readings.channels[c]) for c in readings.channel]
    usual = problem.discrepancy.process.usual[index]
    std = np.hypot(covariance_at(problem, fit, readings).std, usual)
    far = np.abs(readings.measured - prediction) > OUTLIER_SIGMA * std
    return np.asarray(far | ~np.isfinite(prediction))
