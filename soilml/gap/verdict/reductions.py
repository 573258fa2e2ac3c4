"""Figures of a gap before and after: rows fitted, and rows that were kept back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.damped_descents import descend_together
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.predictions import predict
from soilml.fitting.readings import Readings
from soilml.gap.evidence.held_out import (
    INFEASIBLE_SQUARE,
    Folds,
    held_out_folds,
    predicted_beside_remainder,
    predicted_by_refits,
)
from soilml.gap.report.results import BeforeAfter, GapReduction
from soilml.inference.explanation import Explanation
from soilml.inference.gaussian_terms import scatter_columns, terms_like
from soilml.inference.posterior import Posterior
from soilml.inference.search import SOIL_STARTS
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import channel_name, decimal

FITTED = "train"  # Key of the figures of the fitted rows
#: Ratio from which a channel's figure is said to grow, where it is above that of noise alone.
NOTABLE_GROWTH = 1.1
#: Mean squared residual of rows kept back that scatter of a few runs seldom leaves: of two runs,
#: once in fifty times.
UNEXPLAINED = 4.0


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


def plain_fits(posterior: Posterior, shown: Explanation | None) -> tuple[Solution, Solution]:
    """The soil alone and the explanation shown, fitted under noise and scatter, without remainder.

    The explanation starts from its optimum beside a remainder, and from the soil alone with the
    effect absent, so that its objective is at most that of the soil alone. It is the soil alone
    where none is shown, or the model refuses it.
    """
    soil, readings = posterior.soil.fit, posterior.terms.readings

    def problem(fit: Solution) -> LeastSquaresProblem:
        return LeastSquaresProblem(fit.case, fit.coordinates, readings, posterior.whiten)

    elsewhere = [np.asarray([c.prior.fraction(c.nominal) for c in soil.coordinates])]
    elsewhere += [np.full(len(soil.x), x) for x in SOIL_STARTS]
    known = [soil.linearisation, *(None for _ in elsewhere)]
    begun = descend_together([problem(soil)] * len(known), [soil.x, *elsewhere], known)
    carried = [
        f for f in begun if not isinstance(f, InputError) and np.isfinite(f.prediction).all()
    ]
    stays = soil.whitened_by(posterior.whiten)
    alone = min(carried, key=lambda fit: fit.objective, default=stays)
    if shown is None or not shown.hypothesis.effects:
        return alone, alone
    own, values = problem(shown.fit), alone.values()
    absent = [
        0.0 if c.effect else c.prior.fraction(values.get(c.path, c.nominal))
        for c in shown.fit.coordinates
    ]
    starts = [shown.fit.x, np.asarray(absent)]
    found = descend_together([own, own], starts, [shown.fit.linearisation, None])
    solved = [fit for fit in found if not isinstance(fit, InputError)]
    return alone, min([*solved, alone], key=lambda fit: fit.objective)


def gap_reductions(
    posterior: Posterior, shown: Explanation | None, fits: tuple[Solution, Solution], seed: int
) -> tuple[dict[str, GapReduction], dict[str, GapReduction]]:
    """Figures of the fitted rows and of rows kept back, without and with the smooth remainder.

    Before is the soil alone, after the explanation shown; both are of the same kind. Without the
    remainder, both are fitted under noise and scatter, and the total of the fitted rows is the sum
    of squares that these fits minimise, over the number of readings: that of whitened residuals,
    and of deviations from priors of effects and tests of the soil. Outliers count in none.

    fits: By `plain_fits`.
    """
    readings, kept = posterior.terms.readings, ~posterior.outliers
    soil, after = fits
    fitted = _of_readings(posterior, kept, soil.prediction, after.prediction, "all rows fitted")
    squares = [fit.objective / int(kept.sum()) for fit in fits]
    figures = {FITTED: replace(fitted, before=squares[0], after=squares[1])}
    parts = held_out_folds(readings, seed)
    models = [soil] if after is soil else [soil, after]
    plain = predicted_by_refits(posterior, models, parts)
    beside = {}
    for name, folds in parts.items():
        own = kept & folds.selected
        means = plain[0][name], plain[-1][name]
        figures[name] = _of_readings(posterior, own, *means, folds.description)
        if after is not soil and shown is not None:
            means = _beside(posterior.soil, folds), _beside(shown, folds)
            beside[name] = _of_readings(posterior, own, *means, folds.description)
    return figures, beside


def _beside(node: Explanation, folds: Folds) -> Floats:
    return predicted_beside_remainder(node, folds)


def _of_readings(
    posterior: Posterior, own: NDArray[np.bool_], before: Floats, after: Floats, description: str
) -> GapReduction:
    readings = posterior.terms.readings.subset(own)
    return gap_reduction(readings, posterior.std[own], before[own], after[own], description)


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


def unexplained_figures(figures: dict[str, GapReduction]) -> list[Remark]:
    """A remark on each part of the rows that the soil alone, fitted to the others, leaves.

    A verdict without a gap would contradict such a figure beside it.
    """
    return [
        Remark(
            "region-not-predicted",
            f"{g.description}: mean squared residual {decimal(g.before, 2)} (1 is expected)",
            (name,),
        )
        for name, g in figures.items()
        if name != FITTED and g.before > UNEXPLAINED
    ]


def predict_held_out(
    posterior: Posterior, fits: tuple[Solution, Solution], readings: Readings, description: str
) -> GapReduction:
    """Gap reduction on rows that took no part in the analysis, predicted by both fits.

    Their noise is that of the analysed rows: at the predictions by the second fit, not at readings
    that may have strayed, and with what the noise of slip and load causes.
    """
    old, new = (predict(f.case, f.coordinates, f.x[None, :], readings)[0] for f in fits)
    readings = readings.with_noise_at(new)
    readings = readings.with_noise_of_operation(noise_of_operation(fits[1].fitted(), readings))
    columns = scatter_columns(fits[1].fitted(), readings)
    terms, at = terms_like(posterior.terms, posterior.noise, readings, columns)
    return gap_reduction(readings, terms.std(at), old, new, description)
