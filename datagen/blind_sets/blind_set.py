"""One hidden set: what the analyst is given, and the truth apart from it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.blind_sets.catalogue import hidden
from datagen.blind_sets.factorial_plan import Plan
from datagen.blind_sets.mechanism import Acting
from datagen.blind_sets.noise_processes import CHANNELS, RHO, UNDERSTATED, Sensor, sensors, strayed
from datagen.blind_sets.reference_wheel import settled
from datagen.blind_sets.run_schedules import COLUMN, Drive, heavier, swept
from datagen.blind_sets.soil_families import FAMILIES, FREE, PRIOR, RADIUS, WIDTH, nominal
from datagen.blind_sets.wheel_state import Floats, Push, Rows

#: Run-to-run scatter, one standard deviation: rad of phi, share of the modulus.
SCATTER_PHI, SCATTER_K = np.deg2rad(0.5), 0.05
#: Soils drawn before a plan is given up.
ATTEMPTS = 50

Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Drawn:
    """Measured runs, a region held out from them, the model to explain them with, the truth.

    `columns` and `region` are columns by name, each (rows,): run, slip, load_N, torque_Nm,
    drawbar_pull_N, sinkage_m, and the covariates that vary. `region` is 1.3 to 1.6 times heavier
    than the heaviest run. `model` is the text of a model file that lacks the cause.
    """

    columns: Columns
    region: Columns
    model: str
    truth: dict[str, Any]


def draw(plan: Plan) -> Drawn:
    """The set of a plan; the same to the last bit for the same plan.

    Every row has an equilibrium, with the cause and without: soils that fail are drawn again.
    Raises `RuntimeError` where none is found.
    """
    acting: Acting = tuple((c, plan.size * c.reference) for c in hidden(plan.tier, plan.cause))
    for attempt in range(ATTEMPTS):
        generator = np.random.default_rng((plan.seed, attempt))
        needs = {cause.needs for cause, _ in acting} - {""}
        drive = swept(plan.runs, needs, generator)
        region = heavier(drive, generator)
        soil = FAMILIES[plan.soil_family].soil(generator)
        seen = [_seen(d, soil, plan.scattered, acting, generator) for d in (drive, region)]
        steady = _settled(_rows(region, soil), acting)
        bare = [_settled(_rows(d, soil), ()) for d in (drive, region)]
        if all(np.isfinite(v).all() for p in (*(s for s, _ in seen), steady, *bare) for v in p):
            break
    else:
        raise RuntimeError(f"no soil of the family carries all rows: {plan}")
    declared = sensors(plan.noise)
    said = nominal(soil, plan.free, generator)
    tables = [
        _reported(d, s, declared, plan.tier, generator)
        for d, (s, _) in zip((drive, region), seen, strict=True)
    ]
    truth = {
        "plan": asdict(plan),
        "causes": [
            {"name": c.name, "form": c.form, "parameters": {c.size: {"value": v, "unit": c.unit}}}
            for c, v in acting
        ],
        "soil": soil,
        "attempt": attempt,
        "noise": {
            "declared": {name: asdict(sensor) for name, sensor in declared.items()},
            "true_over_declared": 1.0 / UNDERSTATED if plan.tier == "N4" else 1.0,
            "autocorrelation": RHO if plan.tier == "N2" else 0.0,
        },
        "scatter": {"runs": seen[0][1], "region": seen[1][1]} if plan.scattered else {},
        "covariates": sorted(COLUMN[name] for name in drive.varied),
        "runs_true": _named(seen[0][0]),
        "runs_without": _named(bare[0]),
        "region_true": _named(steady),
        "region_without": _named(bare[1]),
    }
    return Drawn(tables[0], tables[1], _model(said, plan.free, declared), truth)


def write(plan: Plan, folder: Path, truth_folder: Path) -> None:
    """Draw a plan into runs.csv, region.csv and model.toml in one folder, truth.json in another.

    Both folders are made where they are missing; `ValueError` where they are the same.
    """
    if folder.resolve() == truth_folder.resolve():
        raise ValueError(f"{folder}: the truth must lie apart from what the analyst is given")
    drawn = draw(plan)
    folder.mkdir(parents=True, exist_ok=True)
    truth_folder.mkdir(parents=True, exist_ok=True)
    (folder / "runs.csv").write_text(_csv(drawn.columns))
    (folder / "region.csv").write_text(_csv(drawn.region))
    (folder / "model.toml").write_text(drawn.model)
    (truth_folder / "truth.json").write_text(json.dumps(drawn.truth, indent=1) + "\n")


def _rows(drive: Drive, soil: dict[str, float]) -> Rows:
    """Rows on one soil, the same in all of them."""
    size = drive.slip.size
    given = {"radius": RADIUS, "width": WIDTH, **soil}
    full = {name: np.full(size, value) for name, value in given.items()}
    return Rows(slip=drive.slip, load=drive.load, **drive.covariates, **full)


def _seen(
    drive: Drive,
    soil: dict[str, float],
    scattered: bool,
    acting: Acting,
    generator: np.random.Generator,
) -> tuple[list[Floats], dict[str, list[float]]]:
    """True channels of the runs, each on its own soil where it scatters, and that scatter."""
    runs = int(drive.run.max()) + 1
    phi = SCATTER_PHI * generator.standard_normal(runs) * scattered
    k = np.exp(SCATTER_K * generator.standard_normal(runs) * scattered)
    rows = _rows(drive, soil)
    values = {**vars(rows)}
    values["friction_angle"] = rows.friction_angle + phi[drive.run]
    values["kc"], values["kphi"] = rows.kc * k[drive.run], rows.kphi * k[drive.run]
    found = _settled(Rows(**values), acting)
    return found, {"friction_angle_offset_rad": phi.tolist(), "modulus_factor": k.tolist()}


def _settled(rows: Rows, acting: Acting) -> list[Floats]:
    """Torque (N m), drawbar pull (N) and sinkage (m), in the order of the channels."""
    push: Push = settled(rows, acting)
    return [push.torque, push.pull, push.sinkage]


def _reported(
    drive: Drive,
    true: list[Floats],
    declared: dict[str, Sensor],
    tier: str,
    generator: np.random.Generator,
) -> Columns:
    columns: Columns = {"run": drive.names, "slip": drive.slip, "load_N": drive.load}
    for name, values in zip(CHANNELS, true, strict=True):
        columns[name] = strayed(values, declared[name], drive.run, tier, generator)
    for name in drive.varied:
        columns[COLUMN[name]] = drive.covariates[name]
    return columns


def _named(channels: list[Floats]) -> dict[str, list[float]]:
    return {name: values.tolist() for name, values in zip(CHANNELS, channels, strict=True)}


def _model(soil: dict[str, float], free: int, declared: dict[str, Sensor]) -> str:
    """The text of a model file: wheel, soil, what is free in it, and the sensors' noise."""
    lines = ["[gear]", 'type = "wheel"', f"radius = {RADIUS}", f"width = {WIDTH}", "", "[soil]"]
    lines += [f"{name} = {value:.6g}" for name, value in soil.items()]
    lines += ["", "[soil.prior]"]
    lines += [f"{name} = [{PRIOR[name][0]}, {PRIOR[name][1]}]" for name in FREE[:free]]
    lines += ["", "[noise]"]
    lines += [f'{name} = "{sensor.as_setting()}"' for name, sensor in declared.items()]
    return "\n".join(lines) + "\n"


def _csv(columns: Columns) -> str:
    names = list(columns)
    lines = [",".join(names)]
    for row in zip(*columns.values(), strict=True):
        lines.append(",".join(v if isinstance(v, str) else f"{v:.8g}" for v in row))
    return "\n".join(lines) + "\n"
