"""Normal stress on the rim of a wheel: its profile, readings of sensors, and what these average."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, final

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Real
from soilml.errors import FitError, InputError
from soilml.numerics.quadrature import gauss
from soilml.parameters import Parameter, check

#: Gauss points between two samples: there the stress is linear in the angle, the shear
#: displacement is not.
BETWEEN = 3


@final
@dataclass(frozen=True)
class StressProfile:
    """Normal stress against the angle on the rim, linear between samples.

    Valid where the stress is uniform over the width, or `normal` is its mean. Samples may extend
    beyond the stressed arc, where they are zero. Raises `InputError` for what cannot be a profile.

    Parameters
    ----------
    angle
        Contact angle (p,), rad from straight down, positive forward, increasing; p at least 3.
    normal
        Normal stress (p,), Pa, not negative.

    References
    ----------
    Nagatani et al. 2009, section IV.
    """

    angle: Floats
    normal: Floats

    def __post_init__(self) -> None:
        for name in ("angle", "normal"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=np.float64))
        _refuse(self.angle, self.normal)

    @cached_property
    def exit_angle(self) -> float:
        """Exit angle, at which the stress ends in the rear contact, rad."""
        first = int(np.flatnonzero(self.normal > 0)[0])
        return float(self.angle[max(first - 1, 0)])

    @cached_property
    def entry_angle(self) -> float:
        """Entry angle, at which stress and shear displacement begin in front, rad."""
        last = int(np.flatnonzero(self.normal > 0)[-1])
        return float(self.angle[min(last + 1, len(self.angle) - 1)])

    @cached_property
    def peak_angle(self) -> float:
        """Angle of the maximum stress, rad."""
        return float(self.angle[int(np.argmax(self.normal))])

    @cached_property
    def nodes(self) -> tuple[Floats, Floats, Floats]:
        """Quadrature angles (q,), their weights (rad) and the stress there (Pa), exit to entry."""
        inside = (self.angle >= self.exit_angle) & (self.angle <= self.entry_angle)
        angle, normal = self.angle[inside], self.normal[inside]
        share, weight = gauss(BETWEEN)
        step = np.diff(angle)[:, None]
        at = (angle[:-1, None] + step * share).ravel()
        return at, (step * weight).ravel(), np.interp(at, angle, normal)


def _refuse(angle: Floats, normal: Floats) -> None:
    """Raise `InputError` for an invalid profile."""
    if angle.ndim != 1 or angle.shape != normal.shape or len(angle) < 3:
        raise InputError(
            f"a stress profile has angles of shape {angle.shape} and stresses of shape "
            f"{normal.shape}; needed are three points or more, the same number of each"
        )
    _check_angles(angle, normal, "a stress profile")
    if not (np.diff(angle) > 0).all():
        raise InputError("the angles of a stress profile must increase from one sample to the next")
    if (least := float(normal.min())) < 0:
        raise InputError(
            f"a stress profile contains {least:g} Pa; soil does not pull at a rim, so subtract the "
            "sensor's zero and set remaining negative values to 0"
        )
    stressed = angle[normal > 0]
    if len(stressed) == 0:
        raise InputError("a stress profile without contact: every stress is zero")
    if float(np.abs(stressed).max()) >= 0.5 * math.pi:
        raise InputError(
            f"a stress profile has stress at {float(stressed[np.abs(stressed).argmax()]):.3g} rad, "
            "above the axle; angles are from straight down, positive forward"
        )


def _check_angles(angle: Floats, values: Floats, what: str) -> None:
    """Raise `InputError` for values that are not finite, and for angles in degrees."""
    if not (np.isfinite(angle).all() and np.isfinite(values).all()):
        raise InputError(f"{what} has values that are not finite; leave such samples out")
    if (farthest := float(np.abs(angle).max())) > math.pi + 1e-6:
        raise InputError(
            f"{what} reaches to {farthest:g} rad, more than half a turn; angles are in radians "
            "from straight down (np.deg2rad turns degrees into them)"
        )


@final
@dataclass(frozen=True, kw_only=True)
class SensingWheel:
    """A wheel with a row of round force sensors across its rim.

    The defaults are the wheel of Nagatani et al. 2009, sections III and IV. The positions of the
    sensors in the row and their noise are not printed: even spacing and 0.02 N are assumed.
    """

    radius: Annotated[Real, Parameter("m", 0.005, 5.0, "r")] = 0.055
    width: Annotated[Real, Parameter("m", 0.002, 5.0, "b")] = 0.064
    sensors: Annotated[Real, Parameter("1", 1, 1000, "in the row")] = 4
    diameter: Annotated[Real, Parameter("m", 1e-4, 0.1, "of the sensing area")] = 0.0095
    interval: Annotated[Real, Parameter("s", 1e-5, 10.0, "between samples")] = 0.05
    rim_speed: Annotated[Real, Parameter("m/s", 1e-5, 10.0, "r omega")] = 0.0104
    deadband: Annotated[Real, Parameter("N", 0.0, 1e3, "smaller forces read 0")] = 0.1
    saturation: Annotated[Real, Parameter("N", 1e-3, 1e5, "larger forces read this")] = 4.4
    noise: Annotated[Real, Parameter("N", 0.0, 1e3, "standard deviation of a sample")] = 0.02

    def __post_init__(self) -> None:
        check(self, "sensing wheel: ")
        if int(self.sensors) != self.sensors:
            raise InputError(f"the row has {self.sensors:g} sensors; needed is a whole number")

    @property
    def area(self) -> float:
        """Sensing area of one sensor, m^2."""
        return 0.25 * math.pi * float(self.diameter) ** 2

    @property
    def step(self) -> float:
        """Angle (rad) through which the rim turns between two samples."""
        return float(self.interval * self.rim_speed / self.radius)

    @property
    def across(self) -> Floats:
        """Positions of the sensors across the rim, in half widths from its middle, (sensors,)."""
        count = int(self.sensors)
        return np.asarray((2.0 * np.arange(count) + 1.0) / count - 1.0)

    def chords(self, count: int) -> tuple[Floats, Floats]:
        """Angles (rad) from the centre of a sensor and area fractions there, (count,)."""
        turn = math.pi * np.arange(1, count + 1) / (count + 1)
        share = np.sin(turn) ** 2
        return 0.5 * self.diameter / self.radius * np.cos(turn), share / share.sum()


@dataclass(frozen=True)
class MeasuredStress:
    """Mean stress over the sensing area (Pa) against the angle on the rim (rad), (points,) each.

    std: Standard deviation of the mean, Pa; of readings by the scatter between turns.
    in_range: Points whose samples all lie between deadband and saturation: `normal` is unbiased.
    saturated: Fraction of the samples with contact that are at saturation.
    """

    angle: Floats
    normal: Floats
    std: Floats
    in_range: NDArray[np.bool_]
    saturated: float = 0.0


def bin_stress(readings: Mapping[str, Floats], wheel: SensingWheel) -> MeasuredStress:
    """Average readings over turns and sensors, in bins as wide as one sampling interval turns.

    readings: Samples over one or more turns, in any order, (n,) each: `angle_rad` from straight
        down, positive forward, `sensor`, its number in the row from 1, and `force_N`.

    Raises `InputError` for values that are not finite, for angles in degrees, if no sample exceeds
    the deadband, or the number of sensors differs from the wheel's. References: Nagatani et al.
    2009, section IV.
    """
    angle, force = (np.asarray(readings[name], np.float64) for name in ("angle_rad", "force_N"))
    sensor, count = np.asarray(readings["sensor"]).astype(int), int(wheel.sensors)
    _check_angles(angle, force, "a row of readings")
    if set(np.unique(sensor)) != set(range(1, count + 1)):
        raise InputError(
            f"readings of sensors {', '.join(map(str, np.unique(sensor)[:9]))}; the wheel has "
            f"{count} in a row, numbered from 1"
        )
    contact = (force > 0.0) & (force >= wheel.deadband)
    if not contact.any():
        raise InputError(
            f"readings without contact: every sample lies in the deadband of {wheel.deadband:g} N"
        )
    bins = math.ceil(2.0 * math.pi / wheel.step)
    angle_bin = np.minimum((angle + math.pi) // wheel.step, bins - 1).astype(int)
    index = angle_bin * count + sensor - 1
    samples = np.bincount(index, minlength=bins * count).reshape(bins, count)
    occupied = (samples > 0).all(axis=1)
    samples = samples[occupied]

    def mean(value: Floats) -> Floats:
        """By bin and sensor, (bins, sensors)."""
        total = np.bincount(index, value, minlength=bins * count).reshape(bins, count)
        return np.asarray(total[occupied] / samples)

    stress = np.where(contact, force, 0.0) / wheel.area
    normal = mean(stress)
    variance = np.maximum(mean(stress**2) - normal**2, 0.0) / np.maximum(samples - 1, 1)
    in_range = contact & (force < wheel.saturation)
    return MeasuredStress(
        angle=mean(angle).mean(axis=1),
        normal=normal.mean(axis=1),
        std=np.sqrt(variance.sum(axis=1)) / count,
        in_range=(mean(in_range.astype(np.float64)) == 1.0).all(axis=1),
        saturated=float((force >= wheel.saturation).sum() / contact.sum()),
    )


LEAST_BINS = 12  # Fewest bins that show a shape of seven numbers
#: ln of the two exponents a and of n where the search begins, and the weight with which the fit is
#: regularised towards them: where a bin's noise is this share of the largest stress, a deviation of
#: one weighs as much as one bin.
START_SHAPE, SHAPE_WEIGHT = np.asarray([0.4, 0.4, 0.0]), 1e-3
#: Points across the diameter of a sensor.
CHORDS = 24
ENOUGH = 1e-5  # Relative change of misfit and parameters at which the descent ends
#: Root mean square misfit, as a share of the peak, from which on the stress is no single arc.
ROUGH = 0.1
POINTS = 41  # Points of the answer on each side of its peak


def deconvolve(
    binned: MeasuredStress, wheel: SensingWheel, start: Floats | None = None
) -> StressProfile:
    r"""Remove the averaging over the sensor's disc: fit an arc whose disc means match the bins.

    .. math::
        \sigma = \sigma_m (1 - v^a)^n, \quad
        v = \frac{\theta - \theta_m}{\theta_f - \theta_m} \text{ or }
            \frac{\theta_m - \theta}{\theta_m - \theta_r}

    with an exponent `a` of its own on either side of the peak: a = 1, n about 1 is a wedge as under
    Bekker's wheel, a = 2 a parabola. Seven parameters are fitted by least squares to the bins that
    lie entirely between deadband and saturation, so that both ends of the arc, which determine the
    shear displacement, follow from the flanks. The sensor of 9.5 mm spans 10 degrees of a rim of 55
    mm: without this step the arc appears longer and k_x is overestimated by 14 %. Own derivation;
    Nagatani et al. 2009 use the readings uncorrected. Not valid for an arc with two peaks. `start`
    is what `fit_stress_arc` returned for nearly the same readings, and saves time. Raises
    `FitError` if too few bins remain, or they do not form a single arc.
    """
    x = fit_stress_arc(binned, wheel, start)
    leave, entry, peak = x[:3]
    points = np.concatenate(
        [np.linspace(leave, peak, POINTS)[:-1], np.linspace(peak, entry, POINTS)]
    )
    normal = x[6] * _shape(points, x)
    normal[[0, -1]] = 0.0
    return StressProfile(points, normal)


def fit_stress_arc(
    binned: MeasuredStress, wheel: SensingWheel, start: Floats | None = None
) -> Floats:
    """Exit, entry, peak (rad), ln of both exponents a and of n, and maximum stress (Pa), (7,)."""
    angle, seen = binned.angle[binned.in_range], binned.normal[binned.in_range]
    if len(angle) < LEAST_BINS:
        raise FitError(
            f"{len(angle)} bins of the rim in which every sample lies between deadband and "
            f"saturation; {LEAST_BINS} are needed: record more turns, or sample faster"
        )
    offset, share = wheel.chords(CHORDS)
    at, most = angle[:, None] + offset, float(seen.max())

    def size(x: Floats) -> tuple[Floats, float]:
        mean = _shape(at, x) @ share
        return mean, float(mean @ seen) / max(float(mean @ mean), 1e-300)

    def misfit(x: Floats) -> Floats:
        mean, scale = size(x)
        return np.concatenate([(scale * mean - seen) / most, SHAPE_WEIGHT * (x[3:] - START_SHAPE)])

    if start is None:
        start = np.concatenate([[angle[0], angle[-1], angle @ seen / seen.sum()], START_SHAPE])
    from scipy.optimize import least_squares

    # exit < peak < entry throughout: the lengths of both sides are exponentials
    def arc(y: Floats) -> Floats:
        return np.concatenate([[y[0] - np.exp(y[1]), y[0] + np.exp(y[2]), y[0]], y[3:]])

    leave, entry, peak = start[:3]
    first = np.concatenate([[peak, np.log(peak - leave), np.log(entry - peak)], start[3:6]])
    found = least_squares(
        lambda y: misfit(arc(y)), first, method="lm", ftol=ENOUGH, xtol=ENOUGH, gtol=ENOUGH
    )
    x = arc(found.x)
    off = float(np.sqrt(np.mean(misfit(x)[: len(seen)] ** 2)))
    if off > ROUGH:
        raise FitError(
            f"the readings deviate from any single stress arc by {100 * off:.0f} % of the peak: "
            "check for two peaks, a wrong angle, or a failed sensor"
        )
    return np.concatenate([x, [size(x)[1]]])


def _shape(angle: Floats, x: Floats) -> Floats:
    """Shape of the arc at angles (rad); `x` as returned by `fit_stress_arc`."""
    leave, entry, peak = x[:3]
    front, rear, exponent = np.exp(x[3:6])
    ahead = angle > peak
    v = np.where(ahead, (angle - peak) / (entry - peak), (peak - angle) / (peak - leave))
    v = np.clip(v, 0.0, 1.0)
    rest = 1.0 - v ** np.where(ahead, front, rear)
    return np.where(rest > 0.0, np.maximum(rest, 1e-300) ** exponent, 0.0)
