"""One blind set: the data for the analyst, and the truth apart from them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.blind_sets.plans import Plan, active_mechanisms
from datagen.blind_sets.reading_errors import (
    AUTOCORRELATION,
    CHANNELS,
    DECLARED_OVER_TRUE,
    Sensor,
    draw_discrepancies,
    draw_missing,
    sensors,
    simulate_readings,
)
from datagen.blind_sets.reference_wheel import (
    MECHANISMS,
    ActiveMechanisms,
    Floats,
    WheelState,
    solve_equilibrium,
)
from datagen.blind_sets.run_schedules import (
    COVARIATE_COLUMNS,
    POINTS,
    RunSchedule,
    beyond_schedule,
    design_schedule,
    heavier_schedule,
    rows_between,
    slip_range,
    with_both_gears,
)
from datagen.blind_sets.soil_families import (
    FAMILIES,
    FREE_PARAMETERS,
    PRIOR,
    RADIUS,
    WIDTH,
    Wheels,
    draw_wheels,
    nominal_soil,
)

#: Run-to-run scatter, one standard deviation: rad of phi, fraction of the modulus.
SCATTER_PHI, SCATTER_K = np.deg2rad(0.5), 0.05
SCATTER = ("friction_angle_offset_rad", "modulus_factor")  # Its members in the truth
#: Names of the wheels where there are two; mechanisms that only the second has then, because they
#: belong to its rim.
GEARS = ("wheel_a", "wheel_b")
MECHANISMS_OF_ONE_GEAR = ("grousers",)
#: Mechanisms of rig and sensors, which do not act on a vehicle.
OF_THE_RIG = {"slope", "load-transfer", "bearing-friction", *MECHANISMS["S"]}
#: Smallest sinkage with the discrepancy, over that without: a wheel on soil sinks.
LEAST_SINKAGE = 0.3
ATTEMPTS = 50  # Soils tried before a plan is given up

Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class BlindSet:
    """Measured runs, rows that are held out, the analyst's model, and the truth.

    `columns` and `region` are columns by name, each (rows,): run, slip, load_N, torque_Nm,
    drawbar_pull_N, sinkage_m, the covariates that vary, gear where there are two, and time_s where
    it was recorded. `region` is 1.3 to 1.6 times heavier than the heaviest run; `between` has rows
    of the same runs at other slips. Channels that were not measured are NaN. `model`
    is the text of a model file without the hidden mechanism. In `truth`, `runs_true` and
    `region_true` are the readings without noise, as is `between_true`; `beyond` has what a vehicle
    meets within the range of the runs and beyond it, without errors of rig and sensors, NaN where
    no soil carries it; `runs_steady` and
    `runs_without` are without scatter and discrepancy as well, `runs_without` and `region_without`
    without the mechanism.
    """

    columns: Columns
    region: Columns
    between: Columns
    model: str
    truth: dict[str, Any]


def draw_blind_set(plan: Plan, rows: int = POINTS) -> BlindSet:
    """Simulate the blind set of a plan; the same plan gives the same set, bit by bit.

    plan: Mechanism, its size, noise, number of runs, soil family, number of free parameters, seed,
        size of the smooth discrepancy, and design.
    rows: Number of rows in all, of designs that are not about operating points.

    Returns: Runs, held-out region, model text and truth. Every row has an equilibrium with and
    without the mechanism: soils without one are drawn again.

    Raises `RuntimeError` where no soil of the family carries all rows.
    """
    active: ActiveMechanisms = tuple(
        (c, plan.size * c.reference) for c in active_mechanisms(plan.tier, plan.cause)
    )
    for attempt in range(ATTEMPTS):
        generator = np.random.default_rng((plan.seed, attempt))
        extras = np.random.default_rng((plan.seed, attempt, 1))
        needs = {mechanism.needs for mechanism, _ in active} - {""}
        runs = design_schedule(plan.design, plan.runs, needs, generator, rows)
        region = heavier_schedule(runs, generator, slip_range(plan.design))
        soil = FAMILIES[plan.soil_family].soil(generator)
        wheels: Wheels = ((RADIUS, WIDTH),)
        if plan.design == "two-gears":
            same_size = any(m.name in MECHANISMS_OF_ONE_GEAR for m, _ in active)
            wheels, region = draw_wheels(same_size, extras), with_both_gears(region)
        world = _World(soil, wheels, active)
        scatter, simulated = [], []
        for schedule in (runs, region):
            scatter.append(_draw_scatter(schedule, plan.scatter, generator))
            simulated.append(world.channels(schedule, scatter[-1]))
        steady = world.channels(region)
        bare = [replace(world, active=()).channels(d) for d in (runs, region)]
        if not all(np.isfinite(v).all() for p in (*simulated, steady, *bare) for v in p):
            continue
        between = rows_between(runs, np.random.default_rng((plan.seed, attempt, 2)))
        inside = world.channels(between, scatter[0])
        if not all(np.isfinite(v).all() for v in inside):
            continue
        beyond, where = beyond_schedule(runs)
        schedules = (runs, region, between, beyond)
        extra = draw_discrepancies(plan.discrepancy, schedules, simulated[0], extras)
        true = [_sum(s, e) for s, e in zip(simulated, extra[:2], strict=True)]
        inside = _sum(inside, extra[2])
        steady = _sum(steady, extra[1])
        sinkages = [(t[2], s[2]) for t, s in zip(true, simulated, strict=True)]
        if all(np.all(one >= LEAST_SINKAGE * other) for one, other in sinkages):
            break
    else:
        raise RuntimeError(f"no soil of the family carries all rows: {plan}")
    declared = sensors(plan.noise)
    nominal = nominal_soil(soil, plan.free, generator)
    missing = draw_missing(extras) if plan.design == "missing-channels" else ()
    if plan.design == "torque-alone":
        missing = CHANNELS[1:]
    tables = [
        _measure(d, t, declared, plan.tier, missing, generator)
        for d, t in zip((runs, region, between), (*true, inside), strict=True)
    ]
    if plan.timed:
        for d, table in zip((runs, region, between), tables, strict=True):
            # a run takes a quarter of an hour, its rows follow in ten seconds
            row = np.arange(d.run.size) - np.searchsorted(d.run, d.run)
            table["time_s"] = 900.0 * d.run + 10.0 * row
    of_one_gear = MECHANISMS_OF_ONE_GEAR if plan.design == "two-gears" else ()
    of_a_vehicle = tuple((m, size) for m, size in active if m.name not in OF_THE_RIG)
    truth = {
        "plan": asdict(plan),
        "causes": [
            {  # with its gear where only one of two has it
                "name": f"{c.name}@{GEARS[1]}" if c.name in of_one_gear else c.name,
                "form": c.form,
                "parameters": {c.size: {"value": v, "unit": c.unit}},
            }
            for c, v in active
        ],
        "soil": soil,
        "attempt": attempt,
        "noise": {
            "declared": {name: asdict(sensor) for name, sensor in declared.items()},
            "true_over_declared": 1.0 / DECLARED_OVER_TRUE if plan.tier == "N4" else 1.0,
            "autocorrelation": AUTOCORRELATION if plan.tier == "N2" else 0.0,
        },
        "scatter": dict(zip(("runs", "region"), scatter, strict=True)) if plan.scattered else {},
        "scatter_std": {
            "friction_angle_rad": SCATTER_PHI * plan.scatter,
            "modulus_fraction": SCATTER_K * plan.scatter,
        },
        "discrepancy": {"runs": _by_channel(extra[0]), "region": _by_channel(extra[1])},
        "missing": list(missing),
        "covariates": sorted(COVARIATE_COLUMNS[name] for name in runs.varied),
        "runs_true": _by_channel(true[0]),
        "runs_steady": _by_channel(world.channels(runs) if plan.scattered else simulated[0]),
        "runs_without": _by_channel(bare[0]),
        "region_true": _by_channel(steady),
        "region_without": _by_channel(bare[1]),
        "between_true": _by_channel(inside),
        "between_elapsed": between.elapsed.tolist(),
        "region_elapsed": region.elapsed.tolist(),
        "beyond": {
            "where": where.tolist(),
            "slip": beyond.slip.tolist(),
            "load_N": beyond.load.tolist(),
            "covariates": {name: float(v[0]) for name, v in beyond.covariates.items()},
            "true": _by_channel(
                _sum(replace(world, active=of_a_vehicle).channels(beyond), extra[3])
            ),
        },
    }
    model = _model(nominal, plan.free, wheels, declared)
    return BlindSet(tables[0], tables[1], tables[2], model, truth)


def write_blind_set(plan: Plan, folder: Path, truth_folder: Path) -> None:
    """Write runs.csv, region.csv and model.toml of a plan to a folder, truth.json to another.

    Missing folders are created. Raises `ValueError` where both are the same.
    """
    if folder.resolve() == truth_folder.resolve():
        raise ValueError(f"{folder}: the truth must be in another folder than the data")
    blind_set = draw_blind_set(plan)
    folder.mkdir(parents=True, exist_ok=True)
    truth_folder.mkdir(parents=True, exist_ok=True)
    (folder / "runs.csv").write_text(csv_text(blind_set.columns))
    (folder / "region.csv").write_text(csv_text(blind_set.region))
    (folder / "model.toml").write_text(blind_set.model)
    (truth_folder / "truth.json").write_text(json.dumps(blind_set.truth, indent=1) + "\n")


@dataclass(frozen=True)
class _World:
    """A soil, the wheels on it, and the mechanisms that act."""

    soil: dict[str, float]
    wheels: Wheels
    active: ActiveMechanisms

    def channels(
        self, schedule: RunSchedule, scatter: Mapping[str, list[float]] | None = None
    ) -> list[Floats]:
        """Torque (N m), drawbar pull (N) and sinkage (m) of rows, in the order of the channels.

        scatter: Deviation of the soil of each run. A mechanism of one gear does not act on the rows
        of the other.
        """
        size = schedule.slip.size
        full = {name: np.full(size, value) for name, value in self.soil.items()}
        full["radius"], full["width"] = np.array(self.wheels)[schedule.gear].T
        full |= {"elapsed": schedule.elapsed, "slip": schedule.slip, "load": schedule.load}
        if scatter is not None:
            phi, k = (np.asarray(scatter[name])[schedule.run] for name in SCATTER)
            full["friction_angle"] = full["friction_angle"] + phi
            full["kc"], full["kphi"] = full["kc"] * k, full["kphi"] * k
        rows = WheelState(**full, **schedule.covariates)
        shared = tuple((m, v) for m, v in self.active if m.name not in MECHANISMS_OF_ONE_GEAR)
        found = _forces(rows, self.active)
        if len(shared) == len(self.active) or not schedule.gear.any():
            return found
        pairs = zip(found, _forces(rows, shared), strict=True)
        return [np.where(schedule.gear > 0, one, other) for one, other in pairs]


def _forces(rows: WheelState, active: ActiveMechanisms) -> list[Floats]:
    reaction = solve_equilibrium(rows, active)
    return [reaction.torque, reaction.pull, reaction.sinkage]


def _draw_scatter(
    schedule: RunSchedule, size: float, generator: np.random.Generator
) -> dict[str, list[float]]:
    """Deviation of the soil of each run, whose standard deviation is `size` times the usual one."""
    runs = int(schedule.run.max()) + 1
    phi = SCATTER_PHI * generator.standard_normal(runs) * size
    k = np.exp(SCATTER_K * generator.standard_normal(runs) * size)
    return dict(zip(SCATTER, (phi.tolist(), k.tolist()), strict=True))


def _measure(
    schedule: RunSchedule,
    true: list[Floats],
    declared: dict[str, Sensor],
    tier: str,
    missing: tuple[str, ...],
    generator: np.random.Generator,
) -> Columns:
    columns: Columns = {"run": schedule.names, "slip": schedule.slip, "load_N": schedule.load}
    if schedule.gear.any():
        columns["gear"] = np.array(GEARS)[schedule.gear]
    for name, values in zip(CHANNELS, true, strict=True):
        columns[name] = simulate_readings(values, declared[name], schedule.run, tier, generator)
    for name in missing:
        columns[name] = np.full(schedule.slip.size, np.nan)
    for name in schedule.varied:
        columns[COVARIATE_COLUMNS[name]] = schedule.covariates[name]
    return columns


def _sum(channels: list[Floats], more: list[Floats]) -> list[Floats]:
    return [one + other for one, other in zip(channels, more, strict=True)]


def _by_channel(channels: list[Floats]) -> dict[str, list[float]]:
    return {name: values.tolist() for name, values in zip(CHANNELS, channels, strict=True)}


def _model(soil: dict[str, float], free: int, wheels: Wheels, declared: dict[str, Sensor]) -> str:
    """The text of a model file: wheel or wheels, soil, priors of the free parameters, noise."""
    lines = []
    for i, (radius, width) in enumerate(wheels):
        section = "gear" if len(wheels) == 1 else f"gears.{GEARS[i]}"
        lines += [f"[{section}]", 'type = "wheel"', f"radius = {radius}", f"width = {width}", ""]
    lines += ["[soil]"]
    lines += [f"{name} = {value:.6g}" for name, value in soil.items()]
    lines += ["", "[soil.prior]"]
    lines += [f"{name} = [{PRIOR[name][0]}, {PRIOR[name][1]}]" for name in FREE_PARAMETERS[:free]]
    lines += ["", "[noise]"]
    lines += [f'{name} = "{sensor.as_setting()}"' for name, sensor in declared.items()]
    return "\n".join(lines) + "\n"


def csv_text(columns: Columns) -> str:
    """Columns (rows,) by name as the text of a CSV file; readings not taken are blank."""
    lines = [",".join(columns)]
    for row in zip(*columns.values(), strict=True):
        cells = (v if isinstance(v, str) else "" if np.isnan(v) else f"{v:.8g}" for v in row)
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"
