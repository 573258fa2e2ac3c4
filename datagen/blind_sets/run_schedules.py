"""Operating points of the runs of a blind set."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from datagen.blind_sets.reference_wheel import Floats

#: Number of rows in all runs; number of runs and of rows per run in the held-out region.
POINTS, REGION_RUNS, REGION_POINTS = 64, 3, 8
ROWS_BETWEEN = 24  # Number of rows of the same runs that the analyst does not get
SLIP = (0.05, 0.6)
LOAD = (40.0, 150.0)  # N
REGION_LOAD_RATIOS = (1.3, 1.45, 1.6)  # The region's loads over the heaviest load measured
LOADS = {2: 2, 4: 3, 8: 4, 16: 5}  # Number of runs -> number of different loads
MOST_RUN_POINTS = 24  # Rows in one run, at most, where a few runs do not make up the number of rows

#: What a plan may say about its operating points, and about the soil of its runs.
DESIGNS = {
    "sweep": "runs that each sweep the slip at one of several loads",
    "one-load": "all runs at one load",
    "one-run": "one run, at one load",
    "few-runs": "two or three runs, each at its own load",
    "jittered": "the load of each row scatters about the level of its run, and is reported so",
    "jittered-one-load": "the same about one level",
    "repeats": "each operating point is driven two or three times, in different runs",
    "missing-channels": "one or two of the three channels were not measured",
    "unequal-soils": "the soil differs from run to run three times as much as in the others",
    "braking": "slips from braking to driving",
    "two-gears": "two wheels of different size, or with and without lugs, at the same points",
    "few-rows": "one run of five to ten rows at one load, as most published tests are",
    "torque-alone": "torque is the only channel that was measured",
}
FEW_ROWS = (5, 10)  # Fewest and most rows of a design of few
BRAKING_SLIP = (-0.4, 0.6)  # Slips of a design that brakes
#: Standard deviation of a load about its level, as a fraction, drawn for each set.
LOAD_JITTER = (0.003, 0.08)

#: Covariates, fields of `WheelState`: constant values where they do not vary, and columns.
COVARIATE_DEFAULTS = {"speed": 0.05, "pass_number": 1.0, "slip_angle": 0.0}
COVARIATE_COLUMNS = {"speed": "speed_m_s", "pass_number": "pass", "slip_angle": "slip_angle_rad"}
DECOY_PROBABILITY = 0.3  # Probability that a covariate without influence varies


@dataclass(frozen=True)
class RunSchedule:
    """Slip, load (N) and covariates of rows, all (rows,); `run` numbers each row's run from 0.

    `gear` numbers the wheel of each row from 0; `elapsed` is the share of the campaign that is
    over.
    """

    run: NDArray[np.int64]
    names: NDArray[np.str_]
    slip: Floats
    load: Floats
    gear: NDArray[np.int64]
    elapsed: Floats
    covariates: dict[str, Floats]
    varied: tuple[str, ...]

    def select(self, rows: NDArray[np.int64]) -> RunSchedule:
        """These rows, which may be repeated."""
        arrays = ("run", "names", "slip", "load", "gear", "elapsed")
        own = {name: getattr(self, name)[rows] for name in arrays}
        covariates = {name: values[rows] for name, values in self.covariates.items()}
        return replace(self, **own, covariates=covariates)


def design_schedule(
    design: str,
    runs: int,
    needs: set[str],
    generator: np.random.Generator,
    rows: int = POINTS,
) -> RunSchedule:
    """The operating points of a design of `DESIGNS` with a number of runs.

    Designs that are not about operating points have those of `sweep`, with so many rows in all.
    With repeats, the number of runs is rounded to two loads at least, each driven two or three
    times. Two gears halve it: each run is driven with both wheels.
    """
    if design == "few-rows":
        level = LOAD[0] * (LOAD[1] / LOAD[0]) ** generator.uniform()
        rows = int(generator.integers(FEW_ROWS[0], FEW_ROWS[1] + 1))
        return _driven(np.full(runs, level), needs, generator, points=rows)
    if design in ("one-load", "one-run", "jittered-one-load"):
        level = LOAD[0] * (LOAD[1] / LOAD[0]) ** generator.uniform()
        schedule = _driven(np.full(runs, level), needs, generator)
        return _jittered(schedule, generator) if design == "jittered-one-load" else schedule
    if design == "jittered":
        return _jittered(sweep_schedule(runs, needs, generator), generator)
    if design == "repeats":
        times = int(generator.integers(2, 4))
        distinct = max(2, runs // times)
        once = sweep_schedule(distinct, needs, generator, points=POINTS // (distinct * times))
        return _repeated(once, times)
    if design == "two-gears":
        once = sweep_schedule(runs // 2, needs, generator, points=POINTS // runs)
        return with_both_gears(once)
    points = min(rows // runs, MOST_RUN_POINTS * rows // POINTS)
    return sweep_schedule(runs, needs, generator, points=points, slip=slip_range(design))


def slip_range(design: str) -> tuple[float, float]:
    """Smallest and largest slip of a design."""
    return BRAKING_SLIP if design == "braking" else SLIP


def sweep_schedule(
    runs: int,
    needs: set[str],
    generator: np.random.Generator,
    *,
    points: int | None = None,
    slip: tuple[float, float] = SLIP,
) -> RunSchedule:
    """Runs that each sweep the slip at one load, 64 rows in all unless `points` of a run are given.

    Loads are evenly spaced in their logarithm with a small jitter, and repeat where there are more
    runs than loads. The covariates that a mechanism needs vary from run to run. In some sets, so
    does a covariate without influence: the presence of a column does not reveal a mechanism.
    """
    level = LOADS.get(runs, 3)
    shares = (np.arange(level) + 0.0) / (level - 1)
    shares[1:-1] += generator.uniform(-0.15, 0.15, level - 2) / (level - 1)
    loads = LOAD[0] * (LOAD[1] / LOAD[0]) ** shares
    load = generator.permutation(loads[np.arange(runs) % level])
    return _driven(load, needs, generator, points=points, slip=slip)


def heavier_schedule(
    runs: RunSchedule, generator: np.random.Generator, slip: tuple[float, float] = SLIP
) -> RunSchedule:
    """Runs at 1.3 to 1.6 times the heaviest load of others, with the same covariates varied."""
    load = runs.load.max() * np.array(REGION_LOAD_RATIOS)
    values = {name: _spread_over_range(name, REGION_RUNS, generator) for name in COVARIATE_DEFAULTS}
    names = [f"region_{i + 1}" for i in range(REGION_RUNS)]
    region = _schedule(names, load, REGION_POINTS, slip, set(runs.varied), values, generator)
    return replace(region, elapsed=np.ones(region.slip.size))


def rows_between(runs: RunSchedule, generator: np.random.Generator) -> RunSchedule:
    """Rows at other slips of the same runs, each within the slips of its run."""
    of = np.sort(generator.integers(runs.slip.size, size=ROWS_BETWEEN))
    of_run = [runs.slip[runs.run == i] for i in range(int(runs.run.max()) + 1)]
    low, high = (np.asarray([end(slip) for slip in of_run]) for end in (np.min, np.max))
    share = generator.uniform(0.0, 1.0, ROWS_BETWEEN)
    slip = low[runs.run[of]] + share * (high - low)[runs.run[of]]
    return replace(runs.select(of), slip=np.round(slip, 4))


#: Loads beyond those driven, over the lightest and the heaviest; slips beyond the highest driven.
LIGHTER, HEAVIER, FASTER = (0.6, 0.8), (1.25, 1.5), (0.08, 0.15)
BEYOND_SLIPS = 5  # Slips at each load within and beyond those driven


def beyond_schedule(runs: RunSchedule) -> tuple[RunSchedule, NDArray[np.str_]]:
    """Steady rows within the range of others and beyond it, and where each of them is.

    Where: `inside` (other slips and loads between), `lighter`, `heavier` and `faster`. Covariates
    are the medians of the runs.
    """
    low, high = float(runs.load.min()), float(runs.load.max())
    least, most = max(float(runs.slip.min()), 0.0), float(runs.slip.max())
    slips = np.linspace(least, most, BEYOND_SLIPS + 2)[1:-1]
    inside = np.geomspace(low, high, 3)
    loads = {"inside": inside, "lighter": low * np.asarray(LIGHTER)}
    loads["heavier"] = high * np.asarray(HEAVIER)
    rows = [(s, w, where) for where, own in loads.items() for w in own for s in slips]
    rows += [(min(most + s, 0.85), w, "faster") for w in inside for s in FASTER]
    slip, load = (np.asarray([row[i] for row in rows], float) for i in (0, 1))
    usual = {name: np.full(slip.size, np.median(v)) for name, v in runs.covariates.items()}
    schedule = RunSchedule(
        run=np.zeros(slip.size, np.int64),
        names=np.full(slip.size, "beyond"),
        slip=slip,
        load=load,
        gear=np.zeros(slip.size, np.int64),
        elapsed=np.ones(slip.size),
        covariates=usual,
        varied=runs.varied,
    )
    return schedule, np.asarray([row[2] for row in rows])


def _driven(
    load: Floats,
    needs: set[str],
    generator: np.random.Generator,
    *,
    points: int | None = None,
    slip: tuple[float, float] = SLIP,
) -> RunSchedule:
    """One run for each load, with the covariates that are needed, and decoys."""
    runs = load.size
    varied = set(needs)
    decoy = str(generator.choice(list(COVARIATE_DEFAULTS)))
    if generator.random() < DECOY_PROBABILITY:
        varied.add(decoy)
    values = {name: _spread_over_range(name, runs, generator) for name in COVARIATE_DEFAULTS}
    names = [f"run_{i + 1:02d}" for i in range(runs)]
    points = min(POINTS // runs, MOST_RUN_POINTS) if points is None else points
    return _schedule(names, load, points, slip, varied, values, generator)


def _jittered(schedule: RunSchedule, generator: np.random.Generator) -> RunSchedule:
    """The schedule with a load that differs from row to row."""
    low, high = LOAD_JITTER
    std = low * (high / low) ** generator.uniform()
    factor = np.exp(std * generator.standard_normal(schedule.load.size))
    return replace(schedule, load=np.round(schedule.load * factor, 2))


def with_both_gears(schedule: RunSchedule) -> RunSchedule:
    """The runs of a schedule with one wheel, then with another."""
    both = _repeated(schedule, 2)
    return replace(both, gear=np.arange(2).repeat(schedule.run.size))


def _repeated(schedule: RunSchedule, times: int) -> RunSchedule:
    """The runs of a schedule driven again, one after the other; they are named after the first."""
    runs = int(schedule.run.max()) + 1
    again = np.arange(times).repeat(schedule.run.size)
    run = np.tile(schedule.run, times) + runs * again
    prefix = str(schedule.names[0]).rstrip("0123456789")
    names = np.array([f"{prefix}{i + 1:02d}" for i in range(runs * times)])
    rows = schedule.select(np.tile(np.arange(schedule.run.size), times))
    return replace(
        rows,
        run=run,
        names=names[run],
        elapsed=run / max(runs * times - 1, 1),
    )


def _schedule(
    names: list[str],
    load: Floats,
    points: int,
    slip_limits: tuple[float, float],
    varied: set[str],
    values: dict[str, Floats],
    generator: np.random.Generator,
) -> RunSchedule:
    runs = len(names)
    run = np.repeat(np.arange(runs), points)
    share = (np.arange(points)[None, :] + generator.uniform(0.0, 1.0, (runs, points))) / points
    low, high = slip_limits
    slip = np.round((low + (high - low) * share).ravel(), 4)
    return RunSchedule(
        run=run,
        names=np.array(names)[run],
        slip=slip,
        load=np.round(load, 2)[run],
        gear=np.zeros(run.size, dtype=np.int64),
        elapsed=run / max(runs - 1, 1),
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
