"""The soil's shear modulus from the sensor readings of one run, with its uncertainty."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError
from soilml.remarks import Remark
from soilml.systems.force_sensor_wheel.deconvolution import deconvolve, fit_stress_arc
from soilml.systems.force_sensor_wheel.force_balance import (
    MohrCoulomb,
    SteadyRun,
    solve_force_balance,
)
from soilml.systems.force_sensor_wheel.sensor_readings import (
    SensingWheel,
    SensorReadings,
    bin_stress,
)
from soilml.systems.force_sensor_wheel.stress_profile import StressProfile

#: Step of the central differences, in standard deviations of the measured quantity: large enough
#: for the solver's tolerance, small enough for a first-order formula.
STEP_IN_STD = 0.25
MIN_TURNS = 3  # Fewest turns for a jackknife: two degrees of freedom


def jackknife_covariance(
    readings: SensorReadings, figures: Callable[[SensorReadings], Floats]
) -> Floats:
    r"""Covariance of k estimates by the jackknife over turns, (k, k).

    .. math:: C = \frac{t - 1}{t} \sum_i (x_i - \bar x)(x_i - \bar x)^T

    It covers everything that varies from turn to turn, noise and soil, and nothing that is constant
    over the turns. Raises `FitError` for fewer than three turns. References: Tukey 1958.
    """
    turns = len(readings.angle)
    if turns < MIN_TURNS:
        raise FitError(
            f"{turns} turns: the scatter between turns, and with it the uncertainty, needs "
            f"{MIN_TURNS} or more"
        )
    rows = np.arange(turns)
    leave_one_out = [
        figures(SensorReadings(readings.angle[rows != i], readings.force[rows != i])) for i in rows
    ]
    deviation = np.stack(leave_one_out) - np.mean(leave_one_out, axis=0)
    return np.asarray((turns - 1) / turns * deviation.T @ deviation)


def delta_method_covariance(at: SteadyRun, figures: Callable[[SteadyRun], Floats]) -> Floats:
    """Covariance of k estimates from the errors of slip, weight and slope, (k, k).

    First order (delta method): not valid where an estimate is strongly nonlinear within one
    standard deviation.
    """
    total: Floats = np.zeros((1, 1))
    for name in ("slip", "weight", "slope"):
        std = float(getattr(at, f"{name}_std"))
        if std > 0.0:
            value, step = float(getattr(at, name)), STEP_IN_STD * std
            up, down = (figures(replace(at, **{name: value + k * step})) for k in (1.0, -1.0))
            rate = (up - down) / (2.0 * STEP_IN_STD)
            total = total + np.outer(rate, rate)
    return total


def effective_degrees_of_freedom(total: float, jackknifed: float, turns: int) -> float:
    """Effective degrees of freedom of a variance of which a part is a jackknife estimate.

    References: Welch and Satterthwaite 1947; the other parts are treated as exactly known.
    """
    return (turns - 1) * (total / max(jackknifed, 1e-12 * total)) ** 2


def student_t_quantile(degrees_of_freedom: float) -> float:
    """The 95 % quantile of Student's t by the Cornish-Fisher series; 2 % off at two degrees."""
    z = 1.6448536
    first = (z**3 + z) / 4.0
    second = (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0
    third = (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0
    nu = degrees_of_freedom
    return z + first / nu + second / nu**2 + third / nu**3


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
    warnings: tuple[Remark, ...]

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
    readings: SensorReadings, at: SteadyRun, wheel: SensingWheel, strength: MohrCoulomb
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
    >>> wheel, sand = SensingWheel(), MohrCoulomb(friction_angle=math.radians(38.0))
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


def _warnings(saturated_fraction: float, covariance: Floats) -> list[Remark]:
    """Limitations of the data that the user should know."""
    warnings = []
    if saturated_fraction > MAX_SATURATED:
        text = (
            f"{100 * saturated_fraction:.0f} % of the samples with contact are saturated: the peak "
            "of the stress is inferred from its flanks"
        )
        warnings.append(Remark("saturated", text, ("force",)))
    if covariance[0, 0] > MAX_LOG_STD**2:
        text = (
            "this run hardly determines the shear modulus: its standard deviation exceeds half of "
            "its value"
        )
        warnings.append(Remark("weakly-identified", text, ("shear_modulus",)))
    return warnings
