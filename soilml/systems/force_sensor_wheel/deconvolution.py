"""Normal stress at points of the rim, deconvolved from its means over the area of a sensor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError
from soilml.systems.force_sensor_wheel.sensor_readings import BinnedStress, SensingWheel
from soilml.systems.force_sensor_wheel.stress_profile import StressProfile

LEAST_BINS = 12  # Fewest bins that show a shape of seven numbers
#: ln of the two exponents a and of n where the search begins, and the weight with which the fit is
#: regularised towards them: where a bin's noise is this share of the largest stress, a deviation of
#: one weighs as much as one bin.
START_SHAPE, SHAPE_WEIGHT = np.asarray([0.4, 0.4, 0.0]), 1e-3
#: Points across the diameter of a sensor.
CHORDS = 24
STEPS, LONGEST_STEP = 60, 0.2
ENOUGH = 1e-4  # A step that promises less than this share of the misfit is not worth taking
#: Root mean square misfit, as a share of the peak, from which on the stress is no single arc.
ROUGH = 0.1
POINTS = 41  # Points of the answer on each side of its peak


def deconvolve(
    binned: BinnedStress, wheel: SensingWheel, start: Floats | None = None
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
    binned: BinnedStress, wheel: SensingWheel, start: Floats | None = None
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
        return mean, float(mean @ seen / (mean @ mean))

    def misfit(x: Floats) -> Floats:
        mean, scale = size(x)
        return np.concatenate([(scale * mean - seen) / most, SHAPE_WEIGHT * (x[3:] - START_SHAPE)])

    if start is None:
        start = np.concatenate([[angle[0], angle[-1], angle @ seen / seen.sum()], START_SHAPE])
    reach = wheel.diameter / wheel.radius
    x = _descended(misfit, start[:6], angle[0] - reach, angle[-1] + reach)
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


def _descended(misfit: Callable[[Floats], Floats], x: Floats, rear: float, front: float) -> Floats:
    """Levenberg and Marquardt's descent; rear <= exit < peak < entry <= front throughout."""
    r, damping, h = misfit(x), 1e-3, 1e-6
    ways = np.eye(len(x))
    for _ in range(STEPS):
        slope = np.stack([misfit(x + h * e) - misfit(x - h * e) for e in ways], axis=1) / (2 * h)
        normal = slope.T @ slope
        downhill = slope.T @ r
        step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), downhill)
        step = np.clip(step, -LONGEST_STEP, LONGEST_STEP)
        if -(step @ downhill) < ENOUGH * (r @ r):
            break
        trial = x + step
        trial[:2] = np.clip(trial[:2], rear, front)
        ordered = trial[0] < trial[2] < trial[1]
        if ordered and (new := misfit(trial)) @ new < r @ r:
            x, r, damping = trial, new, damping / 5.0
        else:
            damping *= 5.0
    return x
