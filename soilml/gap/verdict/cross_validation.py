"""Gap reduction by an explanation: on the rows it was fitted to, and on held-out rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.gap.data.stacked_readings import StackedReadings
from soilml.gap.report_parts import GapReduction
from soilml.gap.search.marginal_fits import MarginalFit
from soilml.gap.search.problem import FitProblem
from soilml.gap.statistics.coordinates import predict_readings
from soilml.gap.statistics.least_squares import FitRequest, GapFit, descend_together
from soilml.gap.statistics.reml_covariance import (
    Covariance,
    assemble_covariance,
    run_effect_columns,
)
from soilml.quantities import column

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

FOLDS = 4
#: Fraction of the readings, those of highest load or of highest slip, in the held-out region.
REGION_FRACTION = 0.3
#: Squared residual, in variances, of a prediction without equilibrium: ten standard deviations.
INFEASIBLE_SQUARE = 100.0


def gap_reduction(
    readings: StackedReadings, std: Floats, before: Floats, after: Floats, description: str
) -> GapReduction:
    """Mean squared standardised residuals of two predictions, in all and by channel.

    A prediction without equilibrium counts as ten standard deviations off.
    """

    def squares(y: Floats) -> Floats:
        return np.nan_to_num(((readings.reading - y) / std) ** 2, nan=INFEASIBLE_SQUARE)

    old, new = squares(before), squares(after)
    channels = {}
    for i, name in enumerate(readings.channels):
        in_channel = readings.channel == i
        if in_channel.any():
            channels[column(name)] = (float(old[in_channel].mean()), float(new[in_channel].mean()))
    return GapReduction(float(old.mean()), float(new.mean()), channels, len(readings), description)


def held_out_runs(
    problem: FitProblem, soil: MarginalFit, after: MarginalFit, seed: int
) -> GapReduction | None:
    """Cross-validation by runs; None where there are fewer than three runs."""
    runs = len(problem.readings.runs)
    if runs < 3:
        return None
    fold_of_run = np.random.default_rng(seed).permutation(runs) % min(FOLDS, runs)
    fold = fold_of_run[problem.readings.run[problem.readings.row]]
    description = "every run predicted by fits to the others"
    return _cross_validate(problem, soil, after, fold, np.unique(fold), description)


def held_out_region(
    problem: FitProblem, soil: MarginalFit, after: MarginalFit
) -> GapReduction | None:
    """Extrapolation to the highest loads, or to the highest slips where the load hardly varies.

    None where fewer than three loads and fewer than three slips were measured.
    """
    chosen = region_fold(problem.readings)
    if chosen is None:
        return None
    name, out = chosen
    description = f"{name}, predicted from the rest"
    fold = out.astype(np.int64)
    return _cross_validate(problem, soil, after, fold, np.asarray([1]), description)


def region_fold(readings: StackedReadings) -> tuple[str, Mask] | None:
    """The region of the highest loads, or of the highest slips where the load hardly varies.

    Its name and its readings (m,); None where fewer than three loads and fewer than three slips
    were measured.
    """
    by_load = readings.load_levels.count >= 3
    values = readings.load if by_load else readings.slip
    levels = readings.load_levels if by_load else readings.slip_levels
    if levels.count < 3:
        return None
    fractions = np.asarray([np.mean(levels.index >= i) for i in range(levels.count)])
    edge = values[levels.index == np.argmin(np.abs(fractions - REGION_FRACTION))].min()
    name = f"load_N >= {edge:.4g}" if by_load else f"slip >= {edge:.3g}"
    return name, values >= edge


def _cross_validate(
    problem: FitProblem,
    soil: MarginalFit,
    after: MarginalFit,
    fold: NDArray[np.int64],
    predicted_folds: NDArray[np.int64],
    description: str,
) -> GapReduction | None:
    """Predict each fold by refits of both models to all readings outside it."""
    readings = problem.readings
    before = _predict_folds(problem, soil, fold, predicted_folds)
    new = before if after is soil else _predict_folds(problem, after, fold, predicted_folds)
    selected = np.isin(fold, predicted_folds)
    return gap_reduction(
        readings.subset(selected),
        problem.covariance.std[selected],
        before[selected],
        new[selected],
        description,
    )


def _predict_folds(
    problem: FitProblem,
    marginal: MarginalFit,
    fold: NDArray[np.int64],
    predicted_folds: NDArray[np.int64],
) -> Floats:
    """Prediction of each fold by the same model, refitted to all other readings, (m,).

    The fits are made beside the same discrepancy, from its optimum. Readings of a fold without a
    fit, and those of other folds, are NaN.
    """
    fit, readings = marginal.fit, problem.readings
    matrix = problem.discrepancy.matrix(marginal.evidence.amplitude)
    requests = []
    for number in predicted_folds:
        rest = fold != number
        whiten = np.linalg.inv(np.linalg.cholesky(matrix[np.ix_(rest, rest)]))
        requests.append(FitRequest(fit.case, fit.coordinates, readings.subset(rest), whiten, fit.x))
    predicted = np.full(len(readings), np.nan)
    for number, again in zip(predicted_folds, descend_together(requests), strict=True):
        if isinstance(again, InputError):
            continue
        y = predict_readings(again.case, again.coordinates, again.x[None, :], readings)[0]
        predicted[fold == number] = y[fold == number]
    return predicted


def predict_held_out(
    problem: FitProblem,
    soil: GapFit,
    after: GapFit,
    readings: StackedReadings,
    description: str,
) -> GapReduction:
    """Gap reduction on rows that took no part in the analysis, predicted by both fits."""
    old = predict_readings(soil.case, soil.coordinates, soil.x[None, :], readings)[0]
    new = predict_readings(after.case, after.coordinates, after.x[None, :], readings)[0]
    std = covariance_at(problem, after, readings).std
    return gap_reduction(readings, std, old, new, description)


def covariance_at(problem: FitProblem, fit: GapFit, readings: StackedReadings) -> Covariance:
    """The covariance of other readings, by the variance components of the problem."""
    components = problem.covariance.components
    index = {name: i for i, name in enumerate(problem.readings.channels)}
    scale = np.asarray(
        [components.noise_scale[index[n]] if n in index else 1.0 for n in readings.channels]
    )
    columns = run_effect_columns(fit.fitted(), readings)
    return assemble_covariance(readings, columns, replace(components, noise_scale=scale))
