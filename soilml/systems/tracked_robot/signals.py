"""What a tracked robot's sensors wrote, made into the columns of a table.

Distances, currents and pulls at one rate are filtered, averaged where they stand still, and joined
into slip and sinkage. Source: Wang, Yan and Du, J. Terramechanics 77, 2018, sections 3 and 4.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilml.errors import FitError, InputError

Floats = NDArray[np.float64]

#: Samples by which a signal is mirrored at its ends before it is filtered.
MIRRORED = 9
#: Lowest cutoff as a share of the rate; below it the filter's coefficients cancel.
SLOWEST = 1e-5
#: Blocks into which a signal is cut, and the fewest of them that count as standing still.
BLOCKS, FEWEST = 40, 8
#: A block mean this many robust standard deviations from the segment's median is none of it.
FAR = 4.0
#: Standard deviations by which von Neumann's ratio may fall short of 1.
SHORT = 2.0


@dataclass(frozen=True)
class Stationary:
    """The mean over samples `start` to `stop` (excluded), and its standard error; unit as given."""

    mean: float
    std_error: float
    start: int
    stop: int


def low_pass(signal: ArrayLike, rate: float, cutoff: float) -> Floats:
    r"""The signal without what is faster than `cutoff` (Hz), not delayed; (n,), sampled at `rate`.

    .. math:: |H(f)|^2 = \frac{1}{1 + \Omega^4}, \quad
        \Omega = \frac{\tan(\pi f / f_s)}{\tan(\pi f_c / f_s)}

    A Butterworth filter of second order, run forwards and backwards, so that half of the amplitude
    is left at the cutoff. Ends are mirrored about their last sample. The source says low-pass only;
    order and cutoff are ours. References: Butterworth 1930; Gustafsson, IEEE Trans. Signal Proc.
    44(4), 1996, forward-backward filtering.
    """
    x = _clean(signal, "signal", MIRRORED + 1)
    if not (0.0 < rate < math.inf and 0.0 < cutoff < 0.5 * rate):
        raise InputError(
            f"cutoff is {cutoff:g} Hz at a rate of {rate:g} Hz; it must lie between 0 and half that"
        )
    if cutoff < SLOWEST * rate:
        raise InputError(
            f"cutoff is {cutoff:g} Hz at a rate of {rate:g} Hz; below {SLOWEST * rate:g} Hz the "
            "filter loses its digits: take fewer samples first"
        )
    before = 2.0 * x[0] - x[MIRRORED:0:-1]
    after = 2.0 * x[-1] - x[-2 : -MIRRORED - 2 : -1]
    there = _filtered(np.concatenate([before, x, after]), math.tan(math.pi * cutoff / rate))
    back = _filtered(there[::-1], math.tan(math.pi * cutoff / rate))[::-1]
    return back[MIRRORED:-MIRRORED].copy()


def stationary(signal: ArrayLike, above: float = -math.inf) -> Stationary:
    r"""The longest part of a signal (n,) that stands still, its mean and the mean's standard error.

    .. math::
        \eta = \frac{\sum (m_{i+1} - m_i)^2}{2 \sum (m_i - \bar m)^2}, \quad
        \eta \ge 1 - 2 \sqrt{\frac{k - 2}{k^2 - 1}}, \quad
        s_{\bar m}^2 = \frac{\sum (m_i - \bar m)^2}{k (k - 1)}

    over the means m of k blocks, a fortieth of the signal each: they drift, or remember each other,
    where the ratio is small. Their scatter holds what samples within a block have in common, which
    the scatter of samples does not. Parts in which a block stands out are none, nor are blocks
    whose mean is not above `above` (unit of the signal): waiting before the pull stands still too.
    Raises `FitError` where no eight blocks together stand still. References: von Neumann, Ann.
    Math. Stat. 12(4), 1941; Fishman, Oper. Res. 26(5), 1978, batch means. Memory longer than a
    block is taken for drift, and the part found is then too short.
    """
    x = _clean(signal, "signal", 4 * BLOCKS)
    size = len(x) // BLOCKS
    means = x[: size * BLOCKS].reshape(BLOCKS, size).mean(axis=1)
    for count in range(BLOCKS, FEWEST - 1, -1):
        parts = np.lib.stride_tricks.sliding_window_view(means, count)
        still = _still(parts) & (parts > above).all(axis=1)
        if still.any():
            scatter = np.where(still, parts.var(axis=1, ddof=1), np.inf)
            first = int(np.argmin(scatter))
            error = math.sqrt(float(scatter[first]) / count)
            return Stationary(
                float(parts[first].mean()), error, first * size, (first + count) * size
            )
    raise FitError(
        f"no {FEWEST} of {BLOCKS} blocks of the signal stand still together: record for longer at "
        "one pull, or filter what swings more slowly than a block"
    )


def slip_of_displacements(track: ArrayLike, robot: ArrayLike, span: int) -> Floats:
    r"""Slip ratio over each window of `span` samples, (n - span,), from two ways gone (m), (n,).

    .. math:: i = \frac{\Delta L_t - \Delta L}{\Delta L_t}

    of the belt and of the robot. References: Wang et al. 2018, section 4.1.1. For driving: where
    the belt does not move forward within a window there is no slip ratio, and `InputError` is
    raised.
    """
    belt, ground = _clean(track, "track", 2), _clean(robot, "robot", 2)
    _alike(track=belt, robot=ground)
    if not 1 <= span < len(belt):
        raise InputError(f"span is {span} samples; it must lie between 1 and {len(belt) - 1}")
    gone = belt[span:] - belt[:-span]
    if np.any(gone <= 0.0):
        place = int(np.argmin(gone))
        raise InputError(
            f"the track moves by {gone[place]:.3g} m from sample {place} on; it must move forward "
            "within each span: cut the signals, or widen span"
        )
    return np.asarray((gone - (ground[span:] - ground[:-span])) / gone)


def rear_sinkage(rear: ArrayLike, front: ArrayLike, angle: ArrayLike, spacing: float) -> Floats:
    r"""Sinkage (m) of the rear wheel from two laser distances (m) and the inclination (rad).

    .. math:: z_r = l_r + L \sin\delta - l_f

    `angle` is positive with the tail down, `spacing` L (m) that of the sensors; arrays (n,).
    References: Wang et al. 2018, eq. 15, which prints l_r twice; the second is the front reading,
    without which a level robot on unmarked ground would have a sinkage. For angles so small that
    the beams stand upright.
    """
    l_r, l_f, delta = (
        _clean(x, name, 1) for x, name in ((rear, "rear"), (front, "front"), (angle, "angle"))
    )
    _alike(rear=l_r, front=l_f, angle=delta)
    if not 0.0 < spacing < math.inf:
        raise InputError(f"spacing is {spacing:g} m; it must be above 0")
    if np.abs(delta).max() >= 0.5 * math.pi:
        place = int(np.abs(delta).argmax())
        raise InputError(
            f"angle is {delta[place]:g} at sample {place}; needed is an inclination in rad"
        )
    return np.asarray(l_r + spacing * np.sin(delta) - l_f)


def rut_mean(crest: ArrayLike, bottom: ArrayLike, crest_length: float, pitch: float) -> Floats:
    r"""Nominal sinkage (m) of a rut with the marks of grousers, that keeps the soil's volume.

    .. math:: z = \frac{L_1}{L} z_2 + \frac{L - L_1}{L} z_1

    z_2 is `crest` (m), read over the length L_1, z_1 `bottom` (m) over the rest of the pitch L;
    arrays (n,). References: Wang et al. 2018, eqs. 16-17.
    """
    upper, lower = _clean(crest, "crest", 1), _clean(bottom, "bottom", 1)
    _alike(crest=upper, bottom=lower)
    if not 0.0 <= crest_length <= pitch or pitch <= 0.0:
        raise InputError(
            f"crest_length is {crest_length:g} m with a pitch of {pitch:g} m; it must lie between "
            "0 and the pitch"
        )
    share = crest_length / pitch
    return np.asarray(share * upper + (1.0 - share) * lower)


def _filtered(x: Floats, k: float) -> Floats:
    """One run of the filter; k is the tangent of half the cutoff. It starts at rest at x[0]."""
    scale = 1.0 / (1.0 + math.sqrt(2.0) * k + k * k)
    b, a1, a2 = (
        k * k * scale,
        2.0 * (k * k - 1.0) * scale,
        (1.0 - math.sqrt(2.0) * k + k * k) * scale,
    )
    first, second = float(x[0]) * (1.0 - b), float(x[0]) * (b - a2)
    out = []
    for value in x.tolist():
        y = b * value + first
        first = 2.0 * b * value - a1 * y + second
        second = b * value - a2 * y
        out.append(y)
    return np.asarray(out)


def _still(parts: Floats) -> NDArray[np.bool_]:
    """Which rows of block means (parts, k) neither drift nor hold a block that stands out."""
    k = parts.shape[1]
    off = parts - parts.mean(axis=1, keepdims=True)
    square = np.sum(off**2, axis=1)
    change = np.sum(np.diff(parts, axis=1) ** 2, axis=1)
    even = change >= 2.0 * square * (1.0 - SHORT * math.sqrt((k - 2) / (k * k - 1)))
    away = np.abs(parts - np.median(parts, axis=1, keepdims=True))
    spread = 1.4826 * np.median(away, axis=1)
    return np.asarray(even & (away.max(axis=1) <= FAR * spread + 1e-12 * np.abs(parts).max(axis=1)))


def _clean(signal: ArrayLike, name: str, fewest: int) -> Floats:
    """A signal as an array (n,); raises `InputError` where it is short, or has a hole."""
    x = np.asarray(signal, dtype=np.float64)
    if x.ndim != 1 or len(x) < fewest:
        raise InputError(
            f"{name} has the shape {x.shape}; needed is one row of {fewest} samples or more"
        )
    if not np.isfinite(x).all():
        place = int(np.argmin(np.isfinite(x)))
        raise InputError(
            f"{name} is {x[place]} at sample {place}; fill or cut what was not measured"
        )
    return x


def _alike(**signals: Floats) -> None:
    """Raise `InputError` where signals that belong together differ in length."""
    if len({len(x) for x in signals.values()}) > 1:
        told = ", ".join(f"{name} {len(x)}" for name, x in signals.items())
        raise InputError(f"signals of one length are needed; given are samples: {told}")
