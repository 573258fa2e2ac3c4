"""The analysis: covariance, outliers, fit of the soil and search for effects, iterated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.least_squares import Solution
from soilml.fitting.readings import Readings
from soilml.gap.evidence.covariance import (
    RUN_EFFECT_UNITS,
    Covariance,
    VarianceComponents,
    assemble_covariance,
    estimate_covariance,
    run_effect_columns,
)
from soilml.gap.evidence.directions import Signature, effect_signatures, smooth_basis
from soilml.gap.evidence.outliers import MAX_OUTLIER_FRACTION, outliers
from soilml.gap.evidence.problem import FitProblem
from soilml.gap.evidence.score_test import ScoreTest
from soilml.gap.search.stepwise import ResidualTest, SearchResult, search, without_search
from soilml.physics.effects.base import Effect
from soilml.quantities import column
from soilml.remarks import Remark

#: Passes of covariance, outliers and search; each uses the residuals of the best fit of the last.
MAX_PASSES = 2
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

    `error` is the reason why the data could not be analysed, if they could not.
    """

    problem: FitProblem
    result: SearchResult
    outliers: tuple[str, ...]
    error: Remark | None = None


def analyse(
    case: Case,
    free: Sequence[Coordinate],
    readings: Readings,
    effects: Mapping[str, type[Effect]],
    calibration: Mapping[str, float],
    seed: int,
    place: Callable[[int], str],
    progress: Callable[[float], None],
) -> Analysis:
    """Search for the effects that explain what the soil alone does not.

    `place` gives the file and line of a row, for messages; `progress` is called with the share that
    is done.
    """
    coordinates = tuple(free)
    problem = FitProblem(
        case=case,
        soil=coordinates,
        readings=readings,
        covariance=_declared_covariance(readings),
        effects=effects,
        calibration=calibration,
    )
    nominal = np.asarray([f.prior.fraction(f.nominal) for f in free])
    soil = problem.fit_soil([nominal, *(np.full(len(free), x) for x in SOIL_STARTS)])
    result = _no_result(soil)
    infeasible = np.flatnonzero(~np.isfinite(soil.prediction))
    if infeasible.size:
        row = int(readings.row[infeasible[0]])
        text = f"the model cannot carry the load of {place(row)}"
        return Analysis(problem, result, (), Remark("no-equilibrium", text))
    best, excluded = soil, []
    for number in range(MAX_PASSES):
        last = problem.covariance.components
        signatures = result.final_test.signatures
        problem, found = _reestimate_covariance(problem, best, readings, signatures)
        excluded += [f"{name} at {place(row)}" for name, row in found]
        if len(excluded) > MAX_OUTLIER_FRACTION * (len(problem.readings) + len(excluded)):
            text = f"{len(excluded)} readings are outliers: check the sensors first"
            return Analysis(problem, _no_result(soil), (), Remark("many-outliers", text))
        converged = not found and _have_converged(last, problem.covariance.components)
        if result.accepted and converged:
            break
        readings = problem.readings
        soil = problem.fit_soil([soil.x])
        starts = {c.names: c for c in result.candidates}
        result = search(problem, soil, seed, starts, _in_pass(number, progress))
        if not result.accepted:
            break
        best = result.accepted[0].fit
    return Analysis(problem, result, tuple(excluded))


def _in_pass(number: int, progress: Callable[[float], None]) -> Callable[[float], None]:
    """A function of the share of one pass that is done."""
    return lambda share: progress((number + share) / MAX_PASSES)


def _declared_covariance(readings: Readings) -> Covariance:
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


def _reestimate_covariance(
    problem: FitProblem, fit: Solution, readings: Readings, signatures: Sequence[Signature]
) -> tuple[FitProblem, list[tuple[str, int]]]:
    """The problem with covariance estimated from a fit's residuals, outliers excluded.

    The outliers are returned as (column, row).
    """
    case = fit.fitted()
    if not signatures or len(signatures[0].column) != len(readings):
        signatures, _ = effect_signatures(case, readings, problem.effects_not_in(fit))
    declared = problem.declared_amplitude[problem.discrepancy.process.channel] > 0.0
    space = np.column_stack(
        [
            fit.derivatives,
            *[s.column for s in signatures],
            smooth_basis(readings),
            problem.discrepancy.process.columns[:, declared],
        ]
    )
    residual = readings.measured - fit.prediction
    columns = run_effect_columns(case, readings)

    # noise that is a fraction of the reading is evaluated at a smoothed prediction
    typical = VarianceComponents.usual(readings)
    several_runs = len(readings.runs) > 1
    smoothing = assemble_covariance(readings, columns if several_runs else 0.0 * columns, typical)
    readings = readings.with_noise_at(fit.prediction + _gls_prediction(smoothing, residual, space))
    readings = readings.with_noise_of_operation(noise_of_operation(case, readings))

    covariance = assemble_covariance(readings, columns, typical)
    replicates = readings.replicates * len(readings.channels) + readings.channel
    is_outlier = outliers(covariance, residual, space, replicates, readings.run[readings.row])
    excluded = [
        (column(readings.channels[readings.channel[i]]), int(readings.row[i]))
        for i in np.flatnonzero(is_outlier)
    ]
    kept = ~is_outlier
    readings = readings.subset(kept)
    covariance = estimate_covariance(readings, columns[kept], residual[kept], space[kept])
    return replace(problem, readings=readings, covariance=covariance), excluded


def _gls_prediction(covariance: Covariance, residual: Floats, space: Floats) -> Floats:
    """Component of the residuals in a column space, by generalised least squares."""
    white = covariance.whiten @ space
    weights = np.linalg.lstsq(white, covariance.whiten @ residual, rcond=GLS_TOLERANCE)[0]
    return np.asarray(space @ weights)


def _no_result(soil: Solution) -> SearchResult:
    """The result before any search: no candidates, and a test without scores."""
    no_test = ResidualTest((), ScoreTest(np.zeros(0), np.zeros(1), np.zeros(0), np.zeros(0)))
    return without_search(soil, no_test)
