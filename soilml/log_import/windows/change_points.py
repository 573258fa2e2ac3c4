"""Where the means of channels change: pieces of a run."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from soilml.arrays import Floats

#: Numbers of values whose means show the long-run noise, and fewest such means.
_WIDTHS, _FEWEST_MEANS = (2, 4, 8, 12), 16
_PENALTY = 2.0  # Factor of the penalty, for long-run noise that is not fully seen


def change_points(values: Floats, penalty: float, shortest: int = 1) -> list[int]:
    r"""First index of each piece of a series (n, channels), without the first, which is 0.

    Minimises the sum over pieces of the squared deviations from their means, plus `penalty` for
    each piece, by dynamic programming over all last pieces, which is exact: Jackson et al., "An
    algorithm for optimal partitioning of data on an interval", IEEE Signal Process. Lett. 12
    (2005), equation 2.

    values: Channels in units of their noise.
    penalty: Cost of a piece; for a change in all channels, about (channels + 2) ln n.
    shortest: Fewest values of a piece.
    """
    n = len(values)
    total = np.vstack([np.zeros(values.shape[1]), np.cumsum(values, axis=0)])
    squares = np.concatenate([[0.0], np.cumsum(np.sum(values**2, axis=1))])
    best = np.full(n + 1, np.inf)
    best[0] = -penalty
    previous = np.zeros(n + 1, dtype=np.int64)
    for stop in range(shortest, n + 1):
        starts = np.arange(stop - shortest + 1)
        sums = total[stop] - total[starts]
        fit = squares[stop] - squares[starts] - np.sum(sums**2, axis=1) / (stop - starts)
        cost = best[starts] + fit + penalty
        previous[stop] = int(np.argmin(cost))
        best[stop] = cost[previous[stop]]
    found = [int(previous[n])]
    while found[-1] > 0:
        found.append(int(previous[found[-1]]))
    return found[-2::-1]


def steady_pieces(
    values: Floats, least_change: Floats, sensitivity: float = 1.0, shortest: int = 1
) -> list[tuple[int, int]]:
    """Pieces (start, stop) of a series (n, channels) in which no channel changes its mean.

    The noise of a channel is the median of its differences from value to value, and at least
    `least_change` (channels,). Correlated noise looks like many small steps: the penalty is
    multiplied by its long-run variance, that of the means of several values times their number,
    which is again a median of differences, so that steps do not raise it.
    """
    n, channels = values.shape
    if n < 2 * shortest:
        return [(0, n)]
    noise = _noise(values)
    unit = np.maximum(noise, least_change)
    long_run = np.ones(channels)
    for width in _WIDTHS:
        if n // width >= _FEWEST_MEANS:
            means = values[: n // width * width].reshape(-1, width, channels).mean(axis=1)
            long_run = np.maximum(long_run, width * (_noise(means) / unit) ** 2)
    penalty = _PENALTY * (channels + 2.0) * np.log(n) / sensitivity
    # channels of much long-run noise count less, instead of raising the penalty of all
    scaled = values / (unit * np.sqrt(long_run))
    return list(pairwise([0, *change_points(scaled, penalty, shortest), n]))


def _noise(values: Floats) -> Floats:
    """Standard deviation of each channel (channels,) from the median of its differences."""
    steps = np.abs(np.diff(values, axis=0))
    return np.asarray(1.4826 * np.median(steps, axis=0) / np.sqrt(2.0))
