"""Noise of the readings of a blind set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from datagen.blind_sets.wheel_state import Floats

#: Constant part of the noise in a column's unit, for each percent of the reading: drawbar pull
#: passes through zero.
FLOOR = {"torque_Nm": 0.0, "drawbar_pull_N": 0.2, "sinkage_m": 0.0}
CHANNELS = tuple(FLOOR)
#: Correlation of a sample with the one before, in tier N2.
AUTOCORRELATION = 0.7
#: Share of readings that are outliers in tier N3, and their distance in standard deviations.
OUTLIER_FRACTION, OUTLIER_SIGMA = 0.02, 8.0
#: Declared noise / true noise in tier N4.
DECLARED_OVER_TRUE = 0.85
#: Probability that one channel was not measured rather than two, where channels are missing.
ONE_MISSING = 2.0 / 3.0


@dataclass(frozen=True)
class Sensor:
    """Noise of one channel as it is declared: a share of the reading and a constant."""

    share: float
    constant: float

    def std(self, true: Floats) -> Floats:
        """One standard deviation at these true readings (n,), in their unit."""
        return np.asarray(np.hypot(self.constant, self.share * np.abs(true)))

    def as_setting(self) -> str:
        """As a model file writes it."""
        floor = f" + {self.constant:g}" if self.constant else ""
        return f"{100.0 * self.share:g} %{floor}"


def sensors(level: float) -> dict[str, Sensor]:
    """The sensors of a set whose noise is `level`, a share of the reading (0.01 is 1 %)."""
    return {name: Sensor(level, 100.0 * level * floor) for name, floor in FLOOR.items()}


def simulate_readings(
    true: Floats,
    sensor: Sensor,
    run: NDArray[np.int64],
    tier: str,
    generator: np.random.Generator,
) -> Floats:
    """Readings (n,) of true values; `run` numbers the run of each row, in the order of sampling.

    Noise is autocorrelated in tier N2, has outliers in tier N3, and is larger than declared in tier
    N4. In all other tiers it is independent, with the declared standard deviation.
    """
    std = sensor.std(true)
    unit = generator.standard_normal(true.size)
    if tier == "N2":
        for i in range(1, true.size):
            if run[i] == run[i - 1]:
                unit[i] = (
                    AUTOCORRELATION * unit[i - 1] + np.sqrt(1.0 - AUTOCORRELATION**2) * unit[i]
                )
    if tier == "N3":
        outlier = generator.random(true.size) < OUTLIER_FRACTION
        unit = np.where(outlier, OUTLIER_SIGMA * np.where(unit < 0.0, -1.0, 1.0), unit)
    if tier == "N4":
        unit = unit / DECLARED_OVER_TRUE
    return np.asarray(true + std * unit)


def draw_missing(generator: np.random.Generator) -> tuple[str, ...]:
    """One or two channels that were not measured."""
    count = 1 if generator.random() < ONE_MISSING else 2
    return tuple(str(name) for name in generator.permutation(CHANNELS)[:count])
