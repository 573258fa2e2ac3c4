"""How the runs of a hidden set are driven."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from datagen.blind_sets.wheel_state import Floats

#: Rows of the runs together, and of the region held out.
POINTS, REGION_RUNS, REGION_POINTS = 64, 3, 8
SLIP = (0.05, 0.6)
LOAD = (40.0, 150.0)  # N
#: The region's loads over the heaviest load measured.
HEAVIER = (1.3, 1.45, 1.6)
#: Number of runs -> how many loads they are driven at.
LOADS = {4: 3, 8: 4, 16: 5}

#: Covariates, fields of `Rows`: what they are where nobody varies them, and their columns.
STILL = {"speed": 0.05, "pass_number": 1.0, "slip_angle": 0.0}
COLUMN = {"speed": "speed_m_s", "pass_number": "pass", "slip_angle": "slip_angle_rad"}
#: How often a covariate is varied that nothing depends on.
DECOY = 0.3


@dataclass(frozen=True)
class Drive:
    """Slip, load (N) and covariates of rows, all (rows,); `run` numbers each row's run from 0."""

    run: NDArray[np.int64]
    names: NDArray[np.str_]
    slip: Floats
    load: Floats
    covariates: dict[str, Floats]
    varied: tuple[str, ...]


def swept(runs: int, needs: set[str], generator: np.random.Generator) -> Drive:
    """Runs that each sweep the slip at one load, 64 rows in all.

    Loads lie evenly in their logarithm and a little off it, and repeat where there are more runs
    than loads. What a cause needs varies from run to run; in some sets so does a covariate on
    which nothing depends, so that a column betrays no cause.
    """
    level = LOADS.get(runs, 3)
    shares = (np.arange(level) + 0.0) / (level - 1)
    shares[1:-1] += generator.uniform(-0.15, 0.15, level - 2) / (level - 1)
    loads = LOAD[0] * (LOAD[1] / LOAD[0]) ** shares
    load = generator.permutation(loads[np.arange(runs) % level])
    varied = set(needs)
    decoy = str(generator.choice(list(STILL)))
    if generator.random() < DECOY:
        varied.add(decoy)
    values = {name: _spread(name, runs, generator) for name in STILL}
    names = [f"run_{i + 1:02d}" for i in range(runs)]
    return _driven(names, load, POINTS // runs, varied, values, generator)


def heavier(drive: Drive, generator: np.random.Generator) -> Drive:
    """Runs at 1.3 to 1.6 times the heaviest load of others, with the same covariates varied."""
    load = drive.load.max() * np.array(HEAVIER)
    values = {name: _spread(name, REGION_RUNS, generator) for name in STILL}
    names = [f"region_{i + 1}" for i in range(REGION_RUNS)]
    return _driven(names, load, REGION_POINTS, set(drive.varied), values, generator)


def _driven(
    names: list[str],
    load: Floats,
    points: int,
    varied: set[str],
    values: dict[str, Floats],
    generator: np.random.Generator,
) -> Drive:
    runs = len(names)
    run = np.repeat(np.arange(runs), points)
    share = (np.arange(points)[None, :] + generator.uniform(0.0, 1.0, (runs, points))) / points
    slip = np.round((SLIP[0] + (SLIP[1] - SLIP[0]) * share).ravel(), 4)
    return Drive(
        run=run,
        names=np.array(names)[run],
        slip=slip,
        load=np.round(load, 2)[run],
        covariates={
            name: values[name][run] if name in varied else np.full(run.size, still)
            for name, still in STILL.items()
        },
        varied=tuple(name for name in STILL if name in varied),
    )


def _spread(name: str, runs: int, generator: np.random.Generator) -> Floats:
    """One value of a covariate for each run, over its range, in an order of its own."""
    share = generator.permutation((np.arange(runs) + generator.uniform(0.0, 1.0, runs)) / runs)
    if name == "speed":
        return np.round(0.01 * 20.0**share, 5)
    if name == "pass_number":
        return np.asarray(np.floor(1.0 + 3.0 * share))
    return np.round(0.3 * share, 4)
