"""Drawbar pull at another slip, from the stress measured there and a known shear modulus."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError
from soilml.remarks import Remark
from soilml.systems.force_sensor_wheel.deconvolution import fit_stress_arc
from soilml.systems.force_sensor_wheel.force_balance import (
    MohrCoulomb,
    SteadyRun,
    solve_vertical_balance,
)
from soilml.systems.force_sensor_wheel.sensor_readings import (
    SensingWheel,
    SensorReadings,
    bin_stress,
)
from soilml.systems.force_sensor_wheel.shear_modulus import (
    STEP_IN_STD,
    ShearModulusEstimate,
    delta_method_covariance,
    effective_degrees_of_freedom,
    jackknife_covariance,
    profile_from_readings,
    student_t_quantile,
)
from soilml.systems.force_sensor_wheel.stress_profile import StressProfile

#: Above this slip the measured k_x dropped to a third of its value at small slip (Table I).
MAX_VALID_SLIP = 0.5


@dataclass(frozen=True)
class PullPrediction:
    """Drawbar pull (N) with its standard deviation, and the magnification that carries the load."""

    drawbar_pull: float
    std: float
    magnification: float
    degrees_of_freedom: float  # of the variance of the drawbar pull
    warnings: tuple[Remark, ...]

    @property
    def interval(self) -> tuple[float, float]:
        """90 % interval of the drawbar pull, N."""
        half_width = student_t_quantile(self.degrees_of_freedom) * self.std
        return self.drawbar_pull - half_width, self.drawbar_pull + half_width


def predict_pull(
    readings: SensorReadings,
    at: SteadyRun,
    wheel: SensingWheel,
    strength: MohrCoulomb,
    modulus: ShearModulusEstimate,
) -> PullPrediction:
    """Predict the drawbar pull from the readings of a run and a shear modulus estimated before.

    Valid for slips up to 0.5 (section V.C of the source). Errors of the estimate, of these readings
    and of this run are treated as independent.

    Parameters
    ----------
    readings
        Readings of three turns or more.
    at
        The run; its slope serves for the load only, weight cos(slope).
    wheel, strength
        The sensors, and the soil's cohesion and friction angle.
    modulus
        Result of `estimate_shear_modulus` from another run.

    Raises
    ------
    FitError
        If no magnification carries the load, or the readings do not form a single arc.

    References
    ----------
    Nagatani et al. 2009, section VI.
    """
    start = fit_stress_arc(bin_stress(readings, wheel), wheel)
    profile = profile_from_readings(readings, wheel, start)

    def balance(profile: StressProfile, at: SteadyRun, log_modulus: float) -> Floats:
        """(magnification, drawbar pull)."""
        modulus = np.exp(np.asarray([log_modulus]))
        return np.concatenate(solve_vertical_balance(profile, at, wheel, strength, modulus))

    log_modulus = float(np.log(modulus.shear_modulus))
    value = balance(profile, at, log_modulus)
    if not np.isfinite(value).all():
        raise FitError("no magnification carries the weight at this slip and shear modulus")
    std = float(np.sqrt(modulus.covariance[0, 0]))
    up, down = (balance(profile, at, log_modulus + k * STEP_IN_STD * std) for k in (1.0, -1.0))
    change_per_std = (up - down) / (2.0 * STEP_IN_STD)
    between_turns = jackknife_covariance(
        readings, lambda r: balance(profile_from_readings(r, wheel, start), at, log_modulus)
    )
    from_run = delta_method_covariance(at, lambda a: balance(profile, a, log_modulus))
    covariance = between_turns + from_run
    covariance = covariance + np.outer(change_per_std, change_per_std)
    warnings: tuple[Remark, ...] = ()
    if float(at.slip) > MAX_VALID_SLIP:
        text = (
            f"slip {float(at.slip):g} exceeds {MAX_VALID_SLIP:g}: measurements show that the shear "
            "modulus found at small slip does not apply there"
        )
        warnings = (Remark("outside-valid-slip", text, ("slip",)),)
    return PullPrediction(
        drawbar_pull=float(value[1]),
        std=float(np.sqrt(covariance[1, 1])),
        magnification=float(value[0]),
        degrees_of_freedom=effective_degrees_of_freedom(
            covariance[1, 1], between_turns[1, 1], len(readings.angle)
        ),
        warnings=warnings,
    )
