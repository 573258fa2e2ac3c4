"""Replicate rows: whether they agree within noise and usual scatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.least_squares import Solution
from soilml.fitting.readings import Readings
from soilml.inference.gaussian_terms import scatter_columns
from soilml.inference.posterior import Posterior
from soilml.quantities import QUANTITIES, column
from soilml.remarks import Remark

REPEAT_LEVEL = 0.001  # Significance level of the test of replicate rows
#: Smaller reading, as a fraction of the larger, from which a difference is also given in per cent:
#: of a reading near zero, per cent say nothing.
MIN_FRACTION_FOR_PERCENT = 0.1


@dataclass(frozen=True)
class RepeatComparison:
    """How the readings of one channel differ between replicate rows."""

    channel: str
    chi_square: float  # squared differences in units of their covariance
    degrees_of_freedom: int  # number of the differences
    p_value: float  # probability of a chi-square as large by chance
    sentence: str  # the pair that differs most in standard deviations, in words and units


def repeat_disagreement(
    readings: Readings, covariance: Floats | None = None, expected: Floats | None = None
) -> list[RepeatComparison]:
    r"""Compare the readings of replicate rows, channel by channel, the least probable first.

    .. math:: \chi^2 = d^T (C V C^T)^{-1} d, \quad d = C (y - \hat y)

    where the rows of C subtract the first reading of each group of repeats from its others.

    covariance (m, m): V, of the readings: declared noise and usual scatter from run to run. The
        declared noise alone by default. Noise that was scaled up to fit the residuals would hide a
        disagreement.
    expected (m,): Predictions, whose small differences within the tolerance of a repeat are
        subtracted.

    References: Rao, Linear Statistical Inference and Its Applications, 2nd edition 1973, section
    8b.
    """
    matrix = np.diag(readings.std**2) if covariance is None else covariance
    value = readings.measured if expected is None else readings.measured - expected
    variance, found = np.diag(matrix), []
    for channel, name in enumerate(readings.channels):
        own = np.flatnonzero(readings.channel == channel)
        i, j = own[np.stack(np.triu_indices(len(own), 1))]
        repeats = readings.replicates[i] == readings.replicates[j]
        i, j = i[repeats], j[repeats]
        if not i.size:
            continue
        other, where = np.unique(j, return_index=True)  # with the first of its group
        first = i[where]
        difference = value[other] - value[first]
        rows = matrix[other] - matrix[first]  # C V
        square = float(difference @ np.linalg.solve(rows[:, other] - rows[:, first], difference))
        squares = variance[i] + variance[j] - 2.0 * matrix[i, j]
        sigma = np.abs(value[i] - value[j]) / np.sqrt(np.where(squares > 0.0, squares, np.inf))
        worst = int(np.argmax(sigma))
        sentence = _pair_sentence(readings, int(i[worst]), int(j[worst]))
        p = chi_square_tail(square, len(other))
        found.append(RepeatComparison(name, square, len(other), p, sentence))
    return sorted(found, key=lambda own: (own.p_value, -own.chi_square / own.degrees_of_freedom))


def repeats_that_disagree(posterior: Posterior, fit: Solution) -> list[Remark]:
    """Replicate rows that differ by more than declared noise and usual scatter explain.

    The predictions of `fit` account for their small differences in slip and load.
    """
    readings, rho = posterior.terms.readings, posterior.noise.autocorrelation
    columns = scatter_columns(fit.fitted(), readings) * float(len(readings.runs) > 1)
    run, order = readings.run[readings.row], readings.order[readings.row]
    same = (run[:, None] == run).astype(np.float64)
    series = same * (readings.channel[:, None] == readings.channel)
    lag = np.abs(np.subtract.outer(order, order))
    sentences: dict[str, str] = {}
    agree: set[str] = set()
    # an estimated correlation of neighbouring samples can hide or make a disagreement: rows
    # disagree only if they do with it and without it
    for correlation in sorted({0.0, rho}):
        noise = series * correlation**lag if correlation else np.eye(len(readings))
        covariance = np.outer(readings.std, readings.std) * noise + same * (columns @ columns.T)
        for comparison in repeat_disagreement(readings, covariance, fit.prediction):
            sentences.setdefault(comparison.channel, comparison.sentence)
            if comparison.p_value >= REPEAT_LEVEL:
                agree.add(comparison.channel)
    return [
        Remark("repeats-disagree", text, (column(channel),))
        for channel, text in sentences.items()
        if channel not in agree
    ]


def _pair_sentence(readings: Readings, i: int, j: int) -> str:
    """Two readings in words: where they were taken, their values and their difference."""
    names = [readings.runs[readings.run[readings.row[k]]] for k in (i, j)]
    quantity = QUANTITIES[readings.channels[readings.channel[i]]]
    low, high = sorted((float(readings.measured[i]), float(readings.measured[j])), key=abs)
    slip, load = readings.slip[[i, j]].mean(), readings.load[[i, j]].mean()
    who = f"run {names[0]} and run {names[1]}"
    if names[0] == names[1]:
        who = f"two rows of run {names[0]}"
    first, second = readings.measured[i], readings.measured[j]
    unit = "" if quantity.unit == "1" else f" {quantity.unit}"
    text = (
        f"{who} at slip {slip:.2f} under {load:.3g} N: {quantity.name.replace('_', ' ')} "
        f"{first:.3g} and {second:.3g}{unit}, which differ by "
    )
    if high != 0.0 and low / high >= MIN_FRACTION_FOR_PERCENT:
        return text + f"{high / low - 1.0:.0%}".replace("%", " %")
    return text + f"{abs(first - second):.2g}{unit}"


def chi_square_tail(value: float, degrees_of_freedom: float) -> float:
    """Probability that a chi-square variable is above a value."""
    from scipy.special import chdtrc

    return float(chdtrc(degrees_of_freedom, value))
