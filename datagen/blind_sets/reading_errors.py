"""What readings have beside the forces of the wheel: smooth discrepancies, noise, gaps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from datagen.blind_sets.reference_wheel import Floats
from datagen.blind_sets.run_schedules import RunSchedule

#: Constant part of the noise in a column's unit, for each percent of the reading: drawbar pull
#: passes through zero.
FLOOR = {"torque_Nm": 0.0, "drawbar_pull_N": 0.2, "sinkage_m": 0.0}
CHANNELS = tuple(FLOOR)
AUTOCORRELATION = 0.7  # Correlation of a sample with the one before, in tier N2
#: Share of readings that are outliers in tier N3, and their distance in standard deviations.
OUTLIER_FRACTION, OUTLIER_SIGMA = 0.02, 8.0
DECLARED_OVER_TRUE = 0.85  # Declared noise / true noise in tier N4
#: Probability that one channel was not measured rather than two, where channels are missing.
ONE_MISSING = 2.0 / 3.0
#: Correlation lengths, in slip and in the logarithm of the load.
SLIP_LENGTH, LOG_LOAD_LENGTH = (0.2, 0.6), (0.4, 1.0)
TERMS = 4  # Number of terms of a function: few, so that it has features and is not Gaussian noise
#: Largest value, in the driven rows and in the region, over the rms of the driven rows: a function
#: that happens to be near zero where the runs are must not be large everywhere else.
MAX_OVER_RMS = 4.0
ATTEMPTS = 200  # Functions tried before a set is given up

#: A function of slip and the logarithm of the load, both (n,) and in correlation lengths.
SmoothFunction = Callable[[Floats, Floats], Floats]


def draw_discrepancies(
    rms: float,
    schedules: tuple[RunSchedule, ...],
    true: list[Floats],
    generator: np.random.Generator,
) -> list[list[Floats]]:
    """The discrepancies of all channels in each schedule; zeros for an rms of zero.

    Channels are independent of each other.

    `true` are the noise-free readings of the runs. The other arguments, and the errors, are those
    of `draw_discrepancy`.
    """
    if rms == 0.0:
        return [[np.zeros(d.slip.size) for _ in true] for d in schedules]
    by_channel = [draw_discrepancy(rms, schedules, t, generator) for t in true]
    return [list(channels) for channels in zip(*by_channel, strict=True)]


def draw_discrepancy(
    rms: float,
    schedules: tuple[RunSchedule, ...],
    true: Floats,
    generator: np.random.Generator,
) -> list[Floats]:
    """The discrepancy of one channel in the runs and in the held-out region.

    It is one smooth function of slip and load, the same in all runs: a sum of a few cosines, bumps
    or steps with random positions, directions and correlation lengths.

    rms: Root mean square over the rows of the runs, as a fraction of the largest absolute reading.
    schedules: Runs and region, of n and m rows, and others where the function is evaluated too.
    true: Noise-free readings of the runs, (n,).

    Returns: (n,), (m,) and so on, in the unit of the channel.

    Raises `RuntimeError` where no function is found that is at most `MAX_OVER_RMS` times its rms
    everywhere.
    """
    scale = rms * float(np.max(np.abs(true)))
    for _ in range(ATTEMPTS):
        kind = FUNCTIONS[int(generator.integers(len(FUNCTIONS)))]
        lengths = generator.uniform(*SLIP_LENGTH), generator.uniform(*LOG_LOAD_LENGTH)
        points = [
            np.stack([d.slip / lengths[0], np.log(d.load) / lengths[1]], axis=0) for d in schedules
        ]
        function = kind(np.concatenate(points[:2], axis=1), generator)
        values = [function(p[0], p[1]) for p in points]
        runs, region = values[:2]
        unit = float(np.sqrt(np.mean(runs**2)))
        if max(np.abs(runs).max(), np.abs(region).max()) <= MAX_OVER_RMS * unit:
            return [scale * value / unit for value in values]
    raise RuntimeError("no smooth function is of similar size in the runs and in the region")


def _cosines(points: Floats, generator: np.random.Generator) -> SmoothFunction:
    """Plane waves with wave numbers of one to two over the correlation length."""
    direction = generator.uniform(0.0, 2.0 * np.pi, TERMS)
    number = generator.uniform(1.0, 2.0, TERMS)
    phase = generator.uniform(0.0, 2.0 * np.pi, TERMS)
    height = generator.standard_normal(TERMS)

    def value(slip: Floats, load: Floats) -> Floats:
        along = np.outer(slip, np.cos(direction)) + np.outer(load, np.sin(direction))
        return np.asarray(np.cos(number * along + phase) @ height)

    return value


def _bumps(points: Floats, generator: np.random.Generator) -> SmoothFunction:
    """Bumps 1 / (1 + d^2)^2 at random places among the rows."""
    low, high = points.min(axis=1), points.max(axis=1)
    centre = generator.uniform(low, high, (TERMS, 2))
    height = generator.standard_normal(TERMS)

    def value(slip: Floats, load: Floats) -> Floats:
        square = np.subtract.outer(slip, centre[:, 0]) ** 2
        square += np.subtract.outer(load, centre[:, 1]) ** 2
        return np.asarray((1.0 + square) ** -2 @ height)

    return value


def _steps(points: Floats, generator: np.random.Generator) -> SmoothFunction:
    """Soft steps tanh(2 d) across random lines through the rows."""
    low, high = points.min(axis=1), points.max(axis=1)
    centre = generator.uniform(low, high, (TERMS, 2))
    direction = generator.uniform(0.0, 2.0 * np.pi, TERMS)
    height = generator.standard_normal(TERMS)

    def value(slip: Floats, load: Floats) -> Floats:
        across = np.subtract.outer(slip, centre[:, 0]) * np.cos(direction)
        across += np.subtract.outer(load, centre[:, 1]) * np.sin(direction)
        return np.asarray(np.tanh(2.0 * across) @ height)

    return value


FUNCTIONS = (_cosines, _bumps, _steps)  # Families of functions, equally probable


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
    true: Floats, sensor: Sensor, run: NDArray[np.int64], tier: str, generator: np.random.Generator
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
