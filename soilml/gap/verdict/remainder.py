"""Size and place of what an explanation leaves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.least_squares import Solution
from soilml.gap.evidence.family_wise import family_wise_p, scores
from soilml.gap.evidence.regions import regions
from soilml.gap.report.results import RegionScore, RemainingDiscrepancy
from soilml.inference.constants import INTERVAL_FACTOR
from soilml.inference.explanation import Explanation
from soilml.inference.posterior import Posterior
from soilml.quantities import QUANTITIES, column
from soilml.report.numbers import decimal, shown_unit

#: Amplitude in usual ones below which no discrepancy of a channel is stated.
LEAST_AMPLITUDE = 0.1
#: Largest variance of the logarithm of an amplitude that counts: little is known of such a one.
MOST_LOG_VARIANCE = 0.5


def remaining_discrepancy(
    posterior: Posterior, before: Explanation, after: Explanation
) -> dict[str, RemainingDiscrepancy]:
    """Root mean square discrepancy of each channel beside two hypotheses, by column."""
    readings, std = posterior.terms.readings, posterior.std
    old, new = (posterior.discrepancy(node) for node in (before, after))
    found = {}
    for i, name in enumerate(readings.channels):
        own = readings.channel == i
        if not own.any():
            continue
        found[column(name)] = RemainingDiscrepancy(
            unit=_unit(name),
            before_value=_rms(old[own]),
            after_value=_rms(new[own]),
            before_sigma=_rms(old[own] / std[own]),
            after_sigma=_rms(new[own] / std[own]),
            description=_largest(new[own], readings.slip[own], readings.load[own], _unit(name)),
        )
    return found


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _unit(channel: str) -> str:
    return QUANTITIES[channel].unit


def _largest(values: Floats, slip: Floats, load: Floats, unit: str) -> str:
    """Where the discrepancy is largest, with its sign; empty where there is none."""
    i = int(np.argmax(np.abs(values)))
    if values[i] == 0.0:
        return ""
    side = "above" if values[i] > 0.0 else "below"
    factor, shown = shown_unit(unit)
    return (
        f"measured {side} the model by up to {decimal(abs(factor * float(values[i])), 2)} {shown}, "
        f"at slip {slip[i]:.2f} under {load[i]:.3g} N"
    )


def discrepancy_amplitudes(
    posterior: Posterior, parts: Sequence[tuple[float, Explanation]]
) -> dict[str, float]:
    """Standard deviation of the discrepancy of each channel, by column, in the column's unit.

    Root mean square over the weighted explanations, the probability that it is present and that of
    its amplitude, with the factor of intervals; a channel with hardly any is left out.
    """
    terms, square = posterior.terms, np.zeros(posterior.terms.channels)
    for weight, node in parts:
        at = node.beside.at
        curvature = node.linear.evaluate(at).curvature[: terms.channels]
        spread = np.minimum(1.0 / np.maximum(curvature, 1e-9), MOST_LOG_VARIANCE)
        square += weight * (1.0 - node.share_without) * (terms.amplitude(at) * np.exp(spread)) ** 2
    amplitude = INTERVAL_FACTOR * np.sqrt(square / sum(weight for weight, _ in parts))
    return {
        column(name): float(a * usual)
        for name, a, usual in zip(terms.readings.channels, amplitude, terms.usual, strict=True)
        if a > LEAST_AMPLITUDE and usual > 0.0
    }


def discrepancy_map(posterior: Posterior, soil: Solution) -> list[RegionScore]:
    """Score of each region of the data against the fit of the soil alone, the largest first.

    The score is positive where the mean reading is above the prediction. Outliers count in none.
    """
    readings, std, whiten = posterior.terms.readings, posterior.std, posterior.whiten
    parts = regions(readings)
    if not parts:
        return []
    columns = np.stack([np.where(r.selected, std, 0.0) for r in parts], axis=1)
    fit = soil.whitened_by(whiten)
    z = np.abs(scores(fit.residual, np.asarray(whiten @ columns), fit.jacobian))
    standardised = (readings.measured - fit.prediction) / std
    found = []
    for i in np.argsort(-z, kind="stable"):
        region, score = parts[i], float(z[i])
        side = float(np.mean(standardised[region.selected]))
        signed, p = float(np.copysign(score, side)), family_wise_p(score, len(parts))
        found.append(RegionScore(column(region.channel), region.slip, region.load, signed, p))
    return found
