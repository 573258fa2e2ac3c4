"""Drawbar pull at another slip, from the stress measured there and a shear modulus found before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.errors import FitError
from soilml.systems.force_sensor_wheel.bin_average import averaged
from soilml.systems.force_sensor_wheel.deconvolution import fitted
from soilml.systems.force_sensor_wheel.force_balance import carrying
from soilml.systems.force_sensor_wheel.sensor_model import Readings, SensingWheel
from soilml.systems.force_sensor_wheel.shear_modulus import Grip, profiled
from soilml.systems.force_sensor_wheel.steady_run import Run, Strength
from soilml.systems.force_sensor_wheel.stress_profile import Floats, StressProfile
from soilml.systems.force_sensor_wheel.uncertainty import (
    NUDGE,
    between_turns,
    freedom,
    from_run,
    student,
)

#: Above this slip the measured k_x fell to a third of what it was (Table I).
BELIEVED = 0.5


@dataclass(frozen=True)
class Pull:
    """Drawbar pull (N) with its standard deviation, and the magnification that carries the load."""

    drawbar_pull: float
    std: float
    magnification: float
    freedom: float  # of the variance of the drawbar pull
    warnings: tuple[str, ...]

    @property
    def interval(self) -> tuple[float, float]:
        """The drawbar pull (N) lies in here nine times in ten."""
        reach = student(self.freedom) * self.std
        return self.drawbar_pull - reach, self.drawbar_pull + reach


def pull(readings: Readings, at: Run, wheel: SensingWheel, strength: Strength, grip: Grip) -> Pull:
    """The drawbar pull with the k_x of `grip` and the stress read at this run.

    The slope of `at` serves for the load only, weight cos(slope). References: Nagatani et al.
    2009, section VI. Errors of `grip`, of these readings and of this run are taken to be
    independent. Holds for slips up to 0.5 (their section V.C). Raises `FitError` where no
    magnification carries the load.
    """
    start = fitted(averaged(readings, wheel), wheel)
    profile = profiled(readings, wheel, start)

    def figures(profile: StressProfile, at: Run, log_modulus: float) -> Floats:
        found = carrying(profile, at, wheel, strength, np.exp(np.asarray([log_modulus])))
        return np.concatenate(found)

    modulus = float(np.log(grip.shear_modulus))
    value = figures(profile, at, modulus)
    if not np.isfinite(value).all():
        raise FitError("no magnification carries the weight at this slip and shear modulus")
    std = float(np.sqrt(grip.covariance[0, 0]))
    up, down = (figures(profile, at, modulus + k * NUDGE * std) for k in (1.0, -1.0))
    rate = (up - down) / (2.0 * NUDGE)
    scatter = between_turns(readings, lambda r: figures(profiled(r, wheel, start), at, modulus))
    covariance = scatter + from_run(at, lambda a: figures(profile, a, modulus))
    covariance = covariance + np.outer(rate, rate)
    said: tuple[str, ...] = ()
    if float(at.slip) > BELIEVED:
        said = (
            f"slip {float(at.slip):g} lies above {BELIEVED:g}, where the shear modulus found at "
            "small slip was measured not to hold",
        )
    return Pull(
        drawbar_pull=float(value[1]),
        std=float(np.sqrt(covariance[1, 1])),
        magnification=float(value[0]),
        freedom=freedom(covariance[1, 1], scatter[1, 1], len(readings.angle)),
        warnings=said,
    )
