"""Ratio of travel to rim displacement in a window, with its standard error."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.windows.mean_errors import mean_error, time_and_window

#: Parts that a window is divided into: for motion without noise of the places, and for noisy
#: places, the first number in which noise is less than half of the variance.
_FINE, _COARSE = 128, (16, 8)
#: Correlation of neighbouring rates below which noise of the places outweighs real motion.
_NOISY = -0.2


def travel_ratio(
    step: float,
    rim: Floats,
    ground: Floats,
    rim_is_place: bool,
    ground_is_place: bool,
    interval: float = 0.0,
) -> tuple[float, float, float, float]:
    r"""Ratio k of travel to rim displacement, its standard error, and both mean speeds, m/s.

    `rim` and `ground` (n,) are speeds in m/s, or places in m. The mean speed of a place is the
    slope of its least-squares line. `interval` is the sampling interval of the slower place, s,
    where it is interpolated to the step.

    What the two differ by, :math:`E = x - k R`, wanders by real fluctuations of slip and is
    blurred by noise of the places. Its rates from part to part of the window have a long-run
    variance S, in which the noise of the places cancels: what it adds to one part it takes from
    the next. The slope of a line over the time t has the variance :math:`6 S / (5 t)`, to which
    :math:`12 \sigma^2 / (n t^2)` is added for the noise of n means of parts. For two speeds the
    error is that of the mean of the rates.
    """
    both = np.isfinite(rim) & np.isfinite(ground)
    if both.sum() < 8:
        return (float("nan"),) * 4
    time: Floats = step * np.arange(rim.size, dtype=np.float64)
    rim_rate = _slope(time[both], rim[both]) if rim_is_place else float(rim[both].mean())
    rate = _slope(time[both], ground[both]) if ground_is_place else float(ground[both].mean())
    if rim_rate == 0.0:
        return float("nan"), float("nan"), rim_rate, rate
    ratio = rate / rim_rate
    if not (rim_is_place or ground_is_place):
        error = mean_error((ground - ratio * rim)[both], step)[1]
        return ratio, error / abs(rim_rate), rim_rate, rate
    difference = _as_place(ground, ground_is_place, step) - ratio * _as_place(
        rim, rim_is_place, step
    )
    error = _slope_error(time[both], difference[both], interval)
    return ratio, error / abs(rim_rate), rim_rate, rate


def _as_place(values: Floats, is_place: bool, step: float) -> Floats:
    if is_place:
        return values
    filled = np.where(np.isfinite(values), values, np.nanmean(values))
    return np.asarray(np.cumsum(filled) * step)


def _slope(time: Floats, values: Floats) -> float:
    centred = time - time.mean()
    return float(centred @ values / (centred @ centred))


def _slope_error(time: Floats, difference: Floats, interval: float) -> float:
    """Standard error of the mean rate of a place that wanders and is noisy, m/s."""
    span = float(time[-1] - time[0])
    residual = difference - difference.mean() - _slope(time, difference) * (time - time.mean())
    fine = min(_FINE, residual.size // 2)
    if interval > 0.0:
        # between two samples a place is a straight line, in which noise looks like real motion
        fine = max(min(fine, int(span / (2.0 * interval))), min(_COARSE[0], fine))
    rates, length = _rates(residual, span, fine)
    size, neighbours = _two_correlations(rates)
    if neighbours > _NOISY * size:
        tau, last, _ = time_and_window(rates)
        freedom = max(rates.size / (2.0 * last + 1.0), 4.0)
        wander = size * length * tau / (1.0 - min(tau / rates.size, 0.5))
        return float(np.sqrt(1.2 * wander / span * freedom / (freedom - 2.0)))
    # white noise of means of one fine part: neighbours have the covariance -(sigma / length)^2
    variance = -neighbours * length**2 / rates.size
    for count in _COARSE:
        rates, length = _rates(residual, span, min(count, residual.size // 2))
        size, neighbours = _two_correlations(rates)
        noise = variance * count / length**2
        if noise < 0.25 * size:
            break
    # the difference of two large numbers: half of its standard error is allowed for
    spread = size * np.sqrt(2.0 / count)
    wander = (max(size + 2.0 * neighbours, size - 2.0 * noise, 0.0) + 0.5 * spread) * length
    freedom = max(count - 1.0, 4.0)
    return float(
        np.sqrt(1.2 * wander / span * freedom / (freedom - 2.0) + 12.0 * variance / span**2)
    )


def _rates(residual: Floats, span: float, count: int) -> tuple[Floats, float]:
    """Rates between the means of neighbouring parts, and the length of a part."""
    edges = np.linspace(0, residual.size, count + 1).astype(int)
    means = np.asarray([part.mean() for part in np.split(residual, edges[1:-1])])
    return np.diff(means) * count / span, span / count


def _two_correlations(rates: Floats) -> tuple[float, float]:
    """Mean square of the rates, and mean product of neighbours."""
    return float(np.mean(rates**2)), float(np.mean(rates[1:] * rates[:-1]))
