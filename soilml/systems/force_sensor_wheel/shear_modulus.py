"""The soil's shear modulus from the sensor readings of one run."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from soilml.systems.force_sensor_wheel.deconvolution import deconvolve, fit_stress_arc
from soilml.systems.force_sensor_wheel.force_balance import (
    ShearStrength,
    SteadyRun,
    solve_force_balance,
)
from soilml.systems.force_sensor_wheel.sensor_readings import (
    SensingWheel,
    SensorReadings,
    bin_stress,
)
from soilml.systems.force_sensor_wheel.shear_modulus import (
    delta_method_covariance,
    effective_degrees_of_freedom,
    jackknife_covariance,
    student_t_quantile,
)
from soilml.systems.force_sensor_wheel.stress_profile import Floats, StressProfile

#: Standard deviation of ln k_x for stress shapes that `deconvolve` does not represent: skewed
#: parabolas and Bekker's wedges were recovered within 3 %.
SHAPE_STD = 0.015
#: Saturated fraction of the samples, and standard deviation of ln k_x, above which a warning is
#: given.
MAX_SATURATED, MAX_LOG_STD = 0.01, 0.5


@dataclass(frozen=True)
class ShearModulusEstimate:
    """Shear modulus (m) and magnification with the covariance of their logarithms, (2, 2)."""

    shear_modulus: float
    magnification: float
    covariance: Floats
    degrees_of_freedom: float  # of the variance of ln k_x
    profile: StressProfile
    warnings: tuple[str, ...]

    @property
    def shear_modulus_std(self) -> float:
        """Standard deviation of k_x, m."""
        return float(self.shear_modulus * np.sqrt(self.covariance[0, 0]))

    @property
    def interval(self) -> tuple[float, float]:
        """90 % interval of k_x, m."""
        half_width = student_t_quantile(self.degrees_of_freedom) * float(
            np.sqrt(self.covariance[0, 0])
        )
        return self.shear_modulus * math.exp(-half_width), self.shear_modulus * math.exp(half_width)


def estimate_shear_modulus(
    readings: SensorReadings, at: SteadyRun, wheel: SensingWheel, strength: ShearStrength
) -> ShearModulusEstimate:
    """Estimate k_x and M with their uncertainty.

    The uncertainty combines a jackknife over turns with the delta method for the errors of slip,
    weight and slope. It excludes errors of c and phi, and lugs whose share of the load changes
    along the arc.

    Parameters
    ----------
    readings
        Readings of three turns or more.
    at
        Slip, weight (N) and slope (rad) of the run, with their standard deviations.
    wheel, strength
        The sensors, and the soil's cohesion and friction angle.

    Raises
    ------
    FitError
        As `solve_force_balance`, `deconvolve` and `jackknife_covariance`.

    References
    ----------
    Nagatani et al. 2009, section V; the uncertainty is our own.

    Examples
    --------
    >>> import math
    >>> from soilml.systems.force_sensor_wheel import balanced_arc, simulate_readings
    >>> wheel, sand = SensingWheel(), ShearStrength(friction_angle=math.radians(38.0))
    >>> run = SteadyRun(slip=0.11, weight=28.92)
    >>> arc = balanced_arc(math.radians(30.0), run, wheel, sand, shear_modulus=0.0072)
    >>> found = estimate_shear_modulus(simulate_readings(arc, wheel), run, wheel, sand)
    >>> round(1e3 * found.shear_modulus, 1), round(1e3 * found.shear_modulus_std, 1)  # mm
    (7.3, 0.1)
    """
    binned = bin_stress(readings, wheel)
    start = fit_stress_arc(binned, wheel)
    profile = deconvolve(binned, wheel, start)

    def log_solution(profile: StressProfile, at: SteadyRun) -> Floats:
        """(ln k_x, ln M)."""
        solution = solve_force_balance(profile, at, wheel, strength)
        return np.log([solution.shear_modulus, solution.magnification])

    value = log_solution(profile, at)
    between_turns = jackknife_covariance(
        readings, lambda r: log_solution(profile_from_readings(r, wheel, start), at)
    )
    covariance = between_turns + delta_method_covariance(at, lambda a: log_solution(profile, a))
    covariance = covariance + np.diag([SHAPE_STD**2, 0.0])
    return ShearModulusEstimate(
        shear_modulus=float(np.exp(value[0])),
        magnification=float(np.exp(value[1])),
        covariance=covariance,
        degrees_of_freedom=effective_degrees_of_freedom(
            covariance[0, 0], between_turns[0, 0], len(readings.angle)
        ),
        profile=profile,
        warnings=tuple(_warnings(binned.saturated_fraction, covariance)),
    )


def profile_from_readings(
    readings: SensorReadings, wheel: SensingWheel, start: Floats | None = None
) -> StressProfile:
    """Bin and deconvolve all readings; `start` as in `deconvolve`."""
    return deconvolve(bin_stress(readings, wheel), wheel, start)


def _warnings(saturated_fraction: float, covariance: Floats) -> list[str]:
    """Limitations of the data that the user should know."""
    warnings = []
    if saturated_fraction > MAX_SATURATED:
        warnings.append(
            f"{100 * saturated_fraction:.0f} % of the samples with contact are saturated: the peak "
            "of the stress is inferred from its flanks"
        )
    if covariance[0, 0] > MAX_LOG_STD**2:
        warnings.append(
            "this run hardly determines the shear modulus: its standard deviation exceeds half of "
            "its value"
        )
    return warnings
