"""Operating points of the runs of a blind set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from datagen.blind_sets.wheel_state import Floats

#: Number of rows in all runs; number of runs and of rows per run in the held-out region.
POINTS, REGION_RUNS, REGION_POINTS = 64, 3, 8
SLIP = (0.05, 0.6)
LOAD = (40.0, 150.0)  # N
#: The region's loads over the heaviest load measured.
REGION_LOAD_RATIOS = (1.3, 1.45, 1.6)
#: Number of runs -> number of different loads.
LOADS = {4: 3, 8: 4, 16: 5}

#: Covariates, fields of `WheelState`: constant values where they do not vary, and columns.
COVARIATE_DEFAULTS = {"speed": 0.05, "pass_number": 1.0, "slip_angle": 0.0}
COVARIATE_COLUMNS = {"speed": "speed_m_s", "pass_number": "pass", "slip_angle": "slip_angle_rad"}
#: Probability that a covariate without influence varies.
DECOY_PROBABILITY = 0.3


@dataclass(frozen=True)
class RunSchedule:
    """Slip, load (N) and covariates of rows, all (rows,); `run` numbers each row's run from 0."""

    run: NDArray[np.int64]
    names: NDArray[np.str_]
    slip: Floats
    load: Floats
    covariates: dict[str, Floats]
    varied: tuple[str, ...]


def sweep_schedule(runs: int, needs: set[str], generator: np.random.Generator) -> RunSchedule:
    """Runs that each sweep the slip at one load, 64 rows in all.

    Loads are evenly spaced in their logarithm with a small jitter, and repeat where there are more
    runs than loads. The covariates that a mechanism needs vary from run to run. In some sets, so
    does a covariate without influence: the presence of a column does not reveal a mechanism.
    """
    level = LOADS.get(runs, 3)
    shares = (np.arange(level) + 0.0) / (level - 1)
    shares[1:-1] += generator.uniform(-0.15, 0.15, level - 2) / (level - 1)
    loads = LOAD[0] * (LOAD[1] / LOAD[0]) ** shares
    load = generator.permutation(loads[np.arange(runs) % level])
    varied = set(needs)
    decoy = str(generator.choice(list(COVARIATE_DEFAULTS)))
    if generator.random() < DECOY_PROBABILITY:
        varied.add(decoy)
    values = {name: _spread_over_range(name, runs, generator) for name in COVARIATE_DEFAULTS}
    names = [f"run_{i + 1:02d}" for i in range(runs)]
    return _schedule(names, load, POINTS // runs, varied, values, generator)


def heavier_schedule(runs: RunSchedule, generator: np.random.Generator) -> RunSchedule:
    """Runs at 1.3 to 1.6 times the heaviest load of others, with the same covariates varied."""
    load = runs.load.max() * np.array(REGION_LOAD_RATIOS)
    values = {name: _spread_over_range(name, REGION_RUNS, generator) for name in COVARIATE_DEFAULTS}
    names = [f"region_{i + 1}" for i in range(REGION_RUNS)]
    return _schedule(names, load, REGION_POINTS, set(runs.varied), values, generator)


def _schedule(
    names: list[str],
    load: Floats,
    points: int,
    varied: set[str],
    values: dict[str, Floats],
    generator: np.random.Generator,
) -> RunSchedule:
    runs = len(names)
    run = np.repeat(np.arange(runs), points)
    share = (np.arange(points)[None, :] + generator.uniform(0.0, 1.0, (runs, points))) / points
    slip = np.round((SLIP[0] + (SLIP[1] - SLIP[0]) * share).ravel(), 4)
    return RunSchedule(
        run=run,
        names=np.array(names)[run],
        slip=slip,
        load=np.round(load, 2)[run],
        covariates={
            name: values[name][run] if name in varied else np.full(run.size, constant)
            for name, constant in COVARIATE_DEFAULTS.items()
        },
        varied=tuple(name for name in COVARIATE_DEFAULTS if name in varied),
    )


def _spread_over_range(name: str, runs: int, generator: np.random.Generator) -> Floats:
    """One value of a covariate for each run, spread over its range in random order."""
    share = generator.permutation((np.arange(runs) + generator.uniform(0.0, 1.0, runs)) / runs)
    if name == "speed":
        return np.round(0.01 * 20.0**share, 5)
    if name == "pass_number":
        return np.asarray(np.floor(1.0 + 3.0 * share))
    return np.round(0.3 * share, 4)
