"""Replicate rows: whether they agree within noise and usual scatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Integers
from soilml.fitting.readings import Readings
from soilml.quantities import QUANTITIES, column
from soilml.remarks import Remark

SIGNIFICANCE = 0.01  # Probability by chance below which repeats scatter less than declared
#: Ratio of the scatter of repeats to the declared noise below which the noise is overstated: the
#: declared variance is then more than four times as large as the measured one.
OVERSTATED_BELOW = 0.5
#: Smaller reading, as a fraction of the larger, from which a difference is also given in per cent:
#: of a reading near zero, per cent say nothing.
MIN_FRACTION_FOR_PERCENT = 0.1


@dataclass(frozen=True)
class RepeatComparison:
    """How the readings of one channel differ between replicate rows.

    channel: Name of the channel, such as ``torque``.
    chi_square, degrees_of_freedom: Squared differences in units of their covariance, and their
        number.
    p_value: Probability of a chi-square as large by chance.
    sentence: The pair that differs most in standard deviations, in words and units.
    """

    channel: str
    chi_square: float
    degrees_of_freedom: int
    p_value: float
    sentence: str

    @property
    def scatter_ratio(self) -> float:
        """Root mean square of the differences in standard deviations; 1 where they are noise."""
        return float(np.sqrt(self.chi_square / self.degrees_of_freedom))


def repeat_disagreement(
    readings: Readings, covariance: Floats | None = None, expected: Floats | None = None
) -> list[RepeatComparison]:
    r"""Compare the readings of replicate rows, channel by channel.

    .. math:: \chi^2 = d^T (C V C^T)^{-1} d, \quad d = C (y - \hat y)

    where the rows of C subtract the first reading of each group of repeats from its others.

    readings: m readings.
    covariance (m, m): V, of the readings: declared noise and usual scatter from run to run. The
        declared noise alone by default. Noise that was scaled up to fit the residuals would hide a
        disagreement.
    expected (m,): Predictions, whose small differences within the tolerance of a repeat are
        subtracted.

    Returns: Of the channels with repeats, the least probable first.

    References: Rao, Linear Statistical Inference and Its Applications, 2nd edition 1973, section
    8b.
    """
    matrix = np.diag(readings.std**2) if covariance is None else covariance
    value = readings.measured if expected is None else readings.measured - expected
    group_of = readings.replicates
    found = []
    for channel in range(len(readings.channels)):
        contrasts = _contrasts(group_of, readings.channel == channel)
        if not len(contrasts):
            continue
        first, other = contrasts.T
        difference = value[other] - value[first]
        rows = matrix[other] - matrix[first]  # C V
        chi_square = float(
            difference @ np.linalg.solve(rows[:, other] - rows[:, first], difference)
        )
        pair = _worst_pair(group_of, readings.channel == channel, value, matrix)
        found.append(
            RepeatComparison(
                channel=readings.channels[channel],
                chi_square=chi_square,
                degrees_of_freedom=len(contrasts),
                p_value=chi_square_tail(chi_square, len(contrasts)),
                sentence=_pair_sentence(readings, *pair),
            )
        )
    return sorted(found, key=lambda found: (found.p_value, -found.scatter_ratio))


def overstated_noise(readings: Readings) -> dict[str, float]:
    """Channels whose declared noise is far above the scatter of repeated rows.

    Returns the ratio of that scatter to the declared noise, by channel, where it is below
    `OVERSTATED_BELOW` and not so by chance.
    """
    found = {}
    for comparison in repeat_disagreement(readings):
        by_chance = 1.0 - chi_square_tail(comparison.chi_square, comparison.degrees_of_freedom)
        if comparison.scatter_ratio < OVERSTATED_BELOW and by_chance < SIGNIFICANCE:
            found[comparison.channel] = comparison.scatter_ratio
    return found


def overstated_noise_notes(readings: Readings) -> list[Remark]:
    """A note on each channel whose declared noise is far above the scatter of repeated rows."""
    return [
        Remark(
            "noise-overstated",
            f"repeated rows of {column(name)} scatter by {ratio:.2g} times the declared noise: the "
            "noise is overstated, which hides small disagreements",
            (column(name),),
        )
        for name, ratio in overstated_noise(readings).items()
    ]


def _contrasts(group_of: Integers, in_channel: NDArray[np.bool_]) -> Integers:
    """The first reading of each group of repeats with each of its others, (k, 2)."""
    pairs = []
    for group in np.unique(group_of[in_channel]):
        own = np.flatnonzero(in_channel & (group_of == group))
        pairs += [(own[0], other) for other in own[1:]]
    return np.asarray(pairs, dtype=np.int64).reshape(-1, 2)


def _worst_pair(
    group_of: Integers, in_channel: NDArray[np.bool_], value: Floats, matrix: Floats
) -> tuple[int, int]:
    """The two repeats that differ most in standard deviations."""
    own = np.flatnonzero(in_channel)
    first, second = np.triu_indices(len(own), 1)
    same = group_of[own[first]] == group_of[own[second]]
    i, j = own[first[same]], own[second[same]]
    variance = np.diag(matrix)
    squares = variance[i] + variance[j] - 2.0 * matrix[i, j]
    sigma = np.abs(value[i] - value[j]) / np.sqrt(np.where(squares > 0.0, squares, np.inf))
    worst = int(np.argmax(sigma))
    return int(i[worst]), int(j[worst])


def _pair_sentence(readings: Readings, i: int, j: int) -> str:
    """Two readings in words: where they were taken, their values and their difference."""
    names = [readings.runs[readings.run[readings.row[k]]] for k in (i, j)]
    quantity = QUANTITIES[readings.channels[readings.channel[i]]]
    low, high = sorted((float(readings.measured[i]), float(readings.measured[j])), key=abs)
    slip = float(np.mean(readings.slip[[i, j]]))
    load = float(np.mean(readings.load[[i, j]]))
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
