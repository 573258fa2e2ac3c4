"""Normal stress at points of the rim, deconvolved from its means over the area of a sensor."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError
from soilml.systems.rim_stress.sensor_readings import MeasuredStress, SensingWheel
from soilml.systems.rim_stress.stress_profile import StressProfile

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
