"""Evaluation of a tracked robot's sensor signals: slip, sinkage and mean pull.

Displacements, pulls and laser distances sampled at one rate are averaged over their stationary
part, and converted to slip and sinkage. Source: Wang, Yan and Du, J. Terramechanics 77, 2018,
sections 3 and 4.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilml.arrays import Floats
from soilml.errors import FitError, InputError

#: Blocks into which a signal is divided, and the fewest consecutive ones of a stationary part.
BLOCKS, MIN_BLOCKS = 40, 8
#: Robust standard deviations from the median at which a block mean is an outlier.
MAX_DEVIATION = 4.0
RATIO_SIGMAS = 2.0  # Standard deviations by which von Neumann's ratio may fall below 1


@dataclass(frozen=True)
class StationaryMean:
    """Mean over samples `start` to `stop` (excluded), and its standard error."""

    mean: float
    std_error: float
    start: int
    stop: int


def stationary_mean(signal: ArrayLike, above: float = -math.inf) -> StationaryMean:
    r"""Mean and standard error over the longest stationary part of a signal (n,).

    .. math::
        \eta = \frac{\sum (m_{i+1} - m_i)^2}{2 \sum (m_i - \bar m)^2}, \quad
        \eta \ge 1 - 2 \sqrt{\frac{k - 2}{k^2 - 1}}, \quad
        s_{\bar m}^2 = \frac{\sum (m_i - \bar m)^2}{k (k - 1)}

    over the means m of k consecutive blocks, a fortieth of the signal each: the ratio is small if
    they drift or are correlated. Their scatter includes correlations within a block, which the
    scatter of samples does not. Parts with an outlying block, or with a block mean not above
    `above` (unit of the signal), are excluded: the pause before a pull is stationary too.
    Correlations over more than a block are interpreted as drift, and the part found is then too
    short. Raises `FitError` if no eight blocks are stationary. References: von Neumann, Ann. Math.
    Stat. 12(4), 1941; Fishman, Oper. Res. 26(5), 1978, batch means.
    """
    x = _check_signal(signal, "signal", 4 * BLOCKS)
    size = len(x) // BLOCKS
    means = x[: size * BLOCKS].reshape(BLOCKS, size).mean(axis=1)
    for count in range(BLOCKS, MIN_BLOCKS - 1, -1):
        parts = np.lib.stride_tricks.sliding_window_view(means, count)
        accepted = _is_stationary(parts) & (parts > above).all(axis=1)
        if accepted.any():
            variance = np.where(accepted, parts.var(axis=1, ddof=1), np.inf)
            first = int(np.argmin(variance))
            error = math.sqrt(float(variance[first]) / count)
            mean = float(parts[first].mean())
            return StationaryMean(mean, error, first * size, (first + count) * size)
    raise FitError(
        f"no {MIN_BLOCKS} consecutive blocks of {BLOCKS} are stationary: record for longer at one "
        "pull, or filter oscillations slower than a block"
    )


def slip_from_displacements(track: ArrayLike, robot: ArrayLike, span: int) -> Floats:
    r"""Slip ratio over windows of `span` samples, (n - span,), from displacements (m), (n,).

    .. math:: i = \frac{\Delta L_t - \Delta L}{\Delta L_t}

    of the belt and of the robot. For driving only: `InputError` is raised if the belt does not move
    forward within a window. References: Wang et al. 2018, section 4.1.1.
    """
    belt, ground = _check_signal(track, "track", span + 1), _check_signal(robot, "robot", span + 1)
    advance = belt[span:] - belt[:-span]
    if np.any(advance <= 0.0):
        worst = int(np.argmin(advance))
        raise InputError(
            f"the track moves by {advance[worst]:.3g} m from sample {worst} on; it must move "
            "forward within each span: cut the signals, or widen span"
        )
    return np.asarray((advance - (ground[span:] - ground[:-span])) / advance)


def rear_sinkage(rear: ArrayLike, front: ArrayLike, angle: ArrayLike, spacing: float) -> Floats:
    r"""Sinkage (m) of the rear wheel from two laser distances (m) and the inclination (rad).

    .. math:: z_r = l_r + L \sin\delta - l_f

    `angle` is positive with the tail down, `spacing` L (m) that of the sensors; arrays (n,). Valid
    for small angles, at which the beams are nearly vertical. References: Wang et al. 2018, eq. 15,
    which prints l_r twice; the second must be the front reading, or a level robot on undisturbed
    ground would have a sinkage.
    """
    names = ("rear", "front", "inclination")
    l_r, l_f, delta = map(_check_signal, (rear, front, angle), names, (1, 1, 1))
    if not (most := float(np.abs(delta).max())) < 0.5 * math.pi:
        raise InputError(f"the inclination reaches {most:g}; needed is an inclination in rad")
    return np.asarray(l_r + spacing * np.sin(delta) - l_f)


def _is_stationary(parts: Floats) -> NDArray[np.bool_]:
    """Which rows of block means (parts, k) neither drift nor contain an outlier."""
    k = parts.shape[1]
    squares = np.sum((parts - parts.mean(axis=1, keepdims=True)) ** 2, axis=1)
    changes = np.sum(np.diff(parts, axis=1) ** 2, axis=1)
    limit = 1.0 - RATIO_SIGMAS * math.sqrt((k - 2) / (k * k - 1))
    no_drift = changes >= 2.0 * squares * limit
    deviation = np.abs(parts - np.median(parts, axis=1, keepdims=True))
    robust_std = 1.4826 * np.median(deviation, axis=1)
    rounding = 1e-12 * np.abs(parts).max(axis=1)
    no_outlier = deviation.max(axis=1) <= MAX_DEVIATION * robust_std + rounding
    return np.asarray(no_drift & no_outlier)


def _check_signal(signal: ArrayLike, name: str, fewest: int) -> Floats:
    """A signal as an array (n,); raises `InputError` if it is too short or has gaps."""
    x = np.asarray(signal, dtype=np.float64)
    if x.ndim != 1 or len(x) < fewest:
        raise InputError(
            f"{name} has the shape {x.shape}; needed is one row of {fewest} samples or more"
        )
    if not np.isfinite(x).all():
        first = int(np.argmin(np.isfinite(x)))
        raise InputError(f"{name} is {x[first]} at sample {first}; fill or cut missing samples")
    return x
