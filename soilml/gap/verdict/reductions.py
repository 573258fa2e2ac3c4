"""Figures of a gap before and after: rows fitted, and rows that were kept back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.damped_descents import COARSE
from soilml.fitting.least_squares import Solution
from soilml.fitting.predictions import predict
from soilml.fitting.readings import Readings
from soilml.gap.evidence.held_out import INFEASIBLE_SQUARE, Folds, held_out_folds, predict_parts
from soilml.gap.evidence.problem import FitProblem, StartedFit, covariance_at, fit_many
from soilml.gap.report.results import BeforeAfter, GapReduction
from soilml.gap.search.explanation import Explanation
from soilml.gap.search.passes import Analysis
from soilml.gap.search.stepwise import off_bounds
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import channel_name, decimal

FITTED = "train"  # Key of the figures of the fitted rows
#: Ratio from which a channel's figure is said to grow, where it is above that of noise alone.
NOTABLE_GROWTH = 1.1


def gap_reduction(
    readings: Readings, std: Floats, before: Floats, after: Floats, description: str
) -> GapReduction:
    """Mean squared standardised residuals of two predictions, in all and by channel.

    A prediction without equilibrium counts as ten standard deviations off.
    """

    def squares(y: Floats) -> Floats:
        return np.nan_to_num(((readings.measured - y) / std) ** 2, nan=INFEASIBLE_SQUARE)

    old, new = squares(before), squares(after)
    channels = {}
    for i, name in enumerate(readings.channels):
        in_channel = readings.channel == i
        if in_channel.any():
            means = float(old[in_channel].mean()), float(new[in_channel].mean())
            channels[column(name)] = BeforeAfter(*means)
    return GapReduction(float(old.mean()), float(new.mean()), channels, len(readings), description)


def plain_fit(problem: FitProblem, soil: Solution, shown: Explanation) -> Solution:
    """An explanation fitted as the soil alone is: under noise and scatter, without a remainder.

    It starts from the optimum beside a remainder, and from the soil alone with the effect absent
    and of usual size, so that its objective is at most that of the soil alone; it is the soil alone
    where the model refuses the explanation.
    """
    fit = shown.fit
    absent = {c.path: 0.0 for c in fit.coordinates if c.effect}
    alone = soil.start_values()
    starts = [
        fit.start_values(),
        alone | absent,
        {path: off_bounds(x) for path, x in alone.items()},
    ]
    own = [StartedFit(fit.case, fit.coordinates, start) for start in starts]
    solved = [x for x in fit_many(problem, own, COARSE) if not isinstance(x, InputError)]
    if solved:
        best = min(solved, key=lambda one: one.objective)
        start = replace(own[0], start=best.start_values(), near=best.linearisation)
        solved += [x for x in fit_many(problem, [start]) if not isinstance(x, InputError)]
    return min([*solved, soil], key=lambda one: _objective_at(problem, one))


def _objective_at(problem: FitProblem, fit: Solution) -> float:
    """The objective of a fit under the noise and scatter of a problem."""
    at = fit.whitened_by(problem.covariance.whiten)
    return float(at.problem.objective(at.residual, at.x))


def gap_reductions(
    analysis: Analysis, shown: Explanation | None, after: Solution, seed: int
) -> tuple[dict[str, GapReduction], dict[str, GapReduction]]:
    """Figures of the fitted rows and of rows kept back, without and with the smooth remainder.

    Before is the soil alone, after the explanation shown; both are of the same kind. Without the
    remainder, both are fitted under noise and scatter, and the total of the fitted rows is the sum
    of squares that these fits minimise, over the number of readings: that of whitened residuals,
    and of deviations from priors of effects and tests of the soil.

    after: The explanation shown, or the soil alone, by `plain_fit`.
    """
    problem, soil = analysis.problem, analysis.result.soil
    readings, std = problem.readings, problem.covariance.std
    fitted = gap_reduction(readings, std, soil.prediction, after.prediction, "all rows fitted")
    count = len(readings)
    squares = [_objective_at(problem, fit) / count for fit in (soil, after)]
    fitted = replace(fitted, before=squares[0], after=squares[1])
    parts = held_out_folds(readings, seed)
    none = np.zeros(len(readings.channels))
    models = [(soil, none)] if shown is None else [(soil, none), (after, none)]
    plain = predict_parts(problem, models, parts)
    figures = {FITTED: fitted}
    for name, folds in parts.items():
        means = plain[0][name].mean, plain[-1][name].mean
        figures[name] = _of_part(readings, std, folds, *means)
    beside = {}
    alone = analysis.predictions.get(())
    if shown is not None and alone is not None and shown.names in analysis.predictions:
        with_effect = analysis.predictions[shown.names]
        for name, folds in parts.items():
            before, new = alone[name], with_effect[name]
            beside[name] = _of_part(readings, std, folds, before.mean, new.mean)
    return figures, beside


def _of_part(
    readings: Readings, std: Floats, folds: Folds, before: Floats, after: Floats
) -> GapReduction:
    own = folds.selected
    return gap_reduction(readings.subset(own), std[own], before[own], after[own], folds.description)


def without_grown(
    figures: dict[str, GapReduction], addition: str
) -> tuple[dict[str, GapReduction], list[Remark]]:
    """The figures of the fitted rows and those that shrank, and a remark on each other one.

    addition: What was added to the model; where that is nothing, all figures stay as they are.
    """
    grown = {n: g for n, g in figures.items() if addition and n != FITTED and not g.shrinks}
    remarks = []
    for name, g in grown.items():
        before, after = (decimal(x, 3) for x in (g.before, g.after))
        text = f"with {addition} the mean squared residual is {after}, without it {before}"
        if before == after:
            text = f"the mean squared residual is {after} with and without {addition}"
        remarks.append(Remark("not-reduced", f"{g.description}: {text}", (name,), "note"))
    return {name: g for name, g in figures.items() if name not in grown}, remarks


def grown_channels(figures: dict[str, GapReduction], addition: str) -> list[Remark]:
    """A remark on the channels whose figures grow although those of all readings shrink."""
    grown = [
        (name, f"{channel_name(name)}: from {decimal(b, 2)} to {decimal(a, 2)} ({g.description})")
        for g in figures.values()
        for name, (b, a) in g.channels.items()
        if a > max(NOTABLE_GROWTH * b, 1.0)
    ]
    if not grown:
        return []
    begin = f"with {addition}, the mean squared residual of all readings shrinks, but that of a "
    each = [f"{text[:1].upper()}{text[1:]}" for _, text in grown]
    text = ". ".join([f"{begin}channel grows", *each])
    return [Remark("channel-grows", text, tuple(dict.fromkeys(n for n, _ in grown)), "note")]


def predict_held_out(
    problem: FitProblem, soil: Solution, after: Solution, readings: Readings, description: str
) -> GapReduction:
    """Gap reduction on rows that took no part in the analysis, predicted by both fits.

    Their noise is that of the analysed rows: at the predictions by `after`, not at readings that
    may have strayed, and with what the noise of slip and load causes.
    """
    old = predict(soil.case, soil.coordinates, soil.x[None, :], readings)[0]
    new = predict(after.case, after.coordinates, after.x[None, :], readings)[0]
    readings = readings.with_noise_at(new)
    readings = readings.with_noise_of_operation(noise_of_operation(after.fitted(), readings))
    std = covariance_at(problem, after, readings).std
    return gap_reduction(readings, std, old, new, description)
