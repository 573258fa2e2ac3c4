"""The soil's shear modulus from what the sensors of a wheel read on one run."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from soilml.systems.force_sensor_wheel.bin_average import averaged
from soilml.systems.force_sensor_wheel.deconvolution import fitted, sharpened
from soilml.systems.force_sensor_wheel.force_balance import solve
from soilml.systems.force_sensor_wheel.sensor_model import Readings, SensingWheel
from soilml.systems.force_sensor_wheel.steady_run import Run, Strength
from soilml.systems.force_sensor_wheel.stress_profile import Floats, StressProfile
from soilml.systems.force_sensor_wheel.uncertainty import between_turns, freedom, from_run, student

#: Standard deviation of ln k_x for shapes of stress that `sharpened` does not hold: parabolas that
#: lean and Bekker's wedges came out within 3 %.
SHAPE = 0.015
#: Warned of from these on.
MUCH_SATURATED, VAGUE = 0.01, 0.5


@dataclass(frozen=True)
class Grip:
    """Shear modulus (m) and magnification with the covariance of their logarithms, (2, 2)."""

    shear_modulus: float
    magnification: float
    covariance: Floats
    freedom: float  # of the variance of ln k_x
    profile: StressProfile
    warnings: tuple[str, ...]

    @property
    def shear_modulus_std(self) -> float:
        """Standard deviation of k_x, m."""
        return float(self.shear_modulus * np.sqrt(self.covariance[0, 0]))

    @property
    def magnification_std(self) -> float:
        """Standard deviation of M."""
        return float(self.magnification * np.sqrt(self.covariance[1, 1]))

    @property
    def interval(self) -> tuple[float, float]:
        """k_x (m) lies in here nine times in ten."""
        reach = student(self.freedom) * float(np.sqrt(self.covariance[0, 0]))
        return self.shear_modulus * math.exp(-reach), self.shear_modulus * math.exp(reach)


def estimate(readings: Readings, at: Run, wheel: SensingWheel, strength: Strength) -> Grip:
    """k_x and M with their uncertainty: jackknife over turns, delta method for the run's errors.

    References: Nagatani et al. 2009, section V; the uncertainty is ours. It leaves out errors of
    c and phi, and lugs whose share of the load changes along the arc. Raises `FitError` as `solve`,
    `sharpened` and `between_turns` do.
    """
    felt = averaged(readings, wheel)
    start = fitted(felt, wheel)
    profile = sharpened(felt, wheel, start)

    def figures(profile: StressProfile, at: Run) -> Floats:
        found = solve(profile, at, wheel, strength)
        return np.log([found.shear_modulus, found.magnification])

    value = figures(profile, at)
    scatter = between_turns(readings, lambda r: figures(profiled(r, wheel, start), at))
    covariance = scatter + from_run(at, lambda a: figures(profile, a))
    covariance = covariance + np.diag([SHAPE**2, 0.0])
    return Grip(
        shear_modulus=float(np.exp(value[0])),
        magnification=float(np.exp(value[1])),
        covariance=covariance,
        freedom=freedom(covariance[0, 0], scatter[0, 0], len(readings.angle)),
        profile=profile,
        warnings=tuple(_said(felt.saturated, covariance)),
    )


def profiled(readings: Readings, wheel: SensingWheel, start: Floats | None = None) -> StressProfile:
    """The stress at points of the rim, from all readings; `start` as in `sharpened`."""
    return sharpened(averaged(readings, wheel), wheel, start)


def _said(saturated: float, covariance: Floats) -> list[str]:
    """What the user should know before believing the figures."""
    said = []
    if saturated > MUCH_SATURATED:
        said.append(
            f"{100 * saturated:.0f} % of the samples with contact are saturated: the top of the "
            "stress is inferred from its flanks"
        )
    if covariance[0, 0] > VAGUE**2:
        said.append("this run hardly tells the shear modulus: its error exceeds half of it")
    return said
