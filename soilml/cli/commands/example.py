"""`soilml example`: files to try the commands with."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from soilml.cli.options import SEVERAL
from soilml.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from soilml.io.table import Table

DESCRIPTION = """\
Write an example into a folder, and say which command to run on it.

  soilml example FOLDER               a campaign whose model lacks an effect
  soilml example log FOLDER           the recording of a rig, in its own units
  soilml example rover FOLDER         a rover, and rows of one of its wheels

and what the source papers measured:

  soilml example sensor-wheel FOLDER  readings of four sensors in a wheel's rim
  soilml example climb FOLDER         gentle climbs of a rover with such wheels
  soilml example wheel-leg FOLDER     strides of a wheel-leg on two soils
  soilml example track FOLDER         the log of a tracked robot's pulls

All measurements are simulated, with noise. Existing files are not replaced.
"""
MODEL = """\
# A wheel on dry sand whose bearing is known and whose shear strength is not.
[gear]
type = "wheel"
radius = 0.15 # m
width = 0.12

[soil]
name = "wong1989/dry_sand"

[soil.prior]
cohesion = [0.0, 3000.0] # Pa
friction_angle = [0.436332, 0.785398] # 25 to 45 degrees, in rad
shear_modulus = [0.005, 0.03] # m

[noise]
torque_Nm = "2 %"
drawbar_pull_N = "2 % + 0.5"
sinkage_m = 0.0005
"""
ROVER = """
[rover]
mass = 30.0 # kg
centre_of_mass = [0.0, 0.0, 0.3] # m: forward, to the left, above the ground

[rover.wheels] # position in m: forward, to the left
front-left = { position = [0.4, 0.3] }
front-right = { position = [0.4, -0.3] }
rear-left = { position = [-0.4, 0.3] }
rear-right = { position = [-0.4, -0.3] }
"""
#: Files of each example, and the command that comes next.
EXAMPLES = {
    "campaign": ("model.toml runs.csv", "gap {0}/model.toml {0}/runs.csv --out {0}/gap"),
    "log": ("model.toml rig.csv", "import --init {0}/rig.csv --out {0}/map.toml"),
    "rover": ("rover.toml runs.csv", "pull {0}/rover.toml {0}/runs.csv --slope 0,10,20"),
    "sensor-wheel": (
        "model.toml runs.csv readings.csv",
        "paper sensor-wheel {0}/model.toml {0}/runs.csv --readings {0}/readings.csv",
    ),
    "climb": (
        "rover.toml runs.csv stress.csv",
        "paper climb {0}/rover.toml {0}/runs.csv --stress {0}/stress.csv",
    ),
    "wheel-leg": ("strides.csv", "paper wheel-leg {0}/strides.csv --by run"),
    "track": (
        "model.toml log.csv",
        "paper track {0}/model.toml {0}/log.csv --mass 130 --spacing 0.6",
    ),
}
SENSOR_WHEEL = """\
# The wheel and the sand of Nagatani et al. 2009.
[gear]
type = "wheel"
radius = 0.055 # m
width = 0.064

[soil]
name = "nagatani2009/toyoura_sand"
"""
CLIMB = """\
# A rover on four equal wheels, on sand whose cohesion and friction angle are known.
[rover]
mass = 12.0 # kg
radius = 0.055 # m
width = 0.064
front_share = 0.52 # of the weight on the front wheels, on the flat
height_ratio = 0.4 # height of the centre of mass over the wheelbase

[soil]
cohesion = 0.0 # Pa
friction_angle = 0.6632 # rad

[soil.prior]
shear_modulus = [0.001, 0.05] # m

[noise]
speed_m_s = "0.87 %" # within 1.5 %
slope_rad = 0.005
normal_Pa = "5 %"
"""
TRACK = """\
# One track of the robot of Wang et al. 2018; its dimensions are assumed.
[gear]
type = "track"
radius = 0.1 # m, end wheel with the belt
width = 0.08
base = 0.6 # m, between the axles

[soil]
name = "wang2018/sand"

[soil.prior]
friction_angle = [0.3, 0.6] # rad
shear_modulus = { range = [0.01, 0.1], scale = "log" } # m
"""
LOADS = (40.0, 55.0, 70.0, 85.0, 100.0, 115.0)  # N
SLIPS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
MEASURED = ("run", "slip", "load_N", "torque_Nm", "drawbar_pull_N", "sinkage_m")
RATE, STAGE, RADIUS = 50.0, 6.0, 0.15  # Rows a second, seconds at each slip, m
ARGUMENTS = (
    (
        "words [NAME] FOLDER",
        f"{', '.join(EXAMPLES)} (default: campaign), and the folder for its files",
        SEVERAL,
    ),
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    from soilml.cli.options import folder_outputs

    name, folder = _name_and_folder(args)
    return folder_outputs("FOLDER", str(folder), EXAMPLES[name][0].split())


def run(args: argparse.Namespace) -> int:
    """Write the files, and say what to do next."""
    from soilml.cli.output import show
    from soilml.io.atomic_files import write_files
    from soilml.optional_imports import need

    need("scipy", "example")
    name, folder = _name_and_folder(args)
    files = [folder / file for file in EXAMPLES[name][0].split()]
    taken = [str(file) for file in files if file.exists()]
    if taken:
        raise InputError(f"{taken[0]} exists; give another folder")
    texts = globals()[f"_{name.replace('-', '_')}"]()
    write_files(dict(zip(files, texts, strict=True)), folders=[folder])
    show(f"{', '.join(map(str, files))} written. Next: soilml {EXAMPLES[name][1].format(folder)}")
    return 0


def _name_and_folder(args: argparse.Namespace) -> tuple[str, Path]:
    name, folder = args.words if len(args.words) == 2 else ("campaign", args.words[0])
    if len(args.words) > 2 or name not in EXAMPLES:
        near = did_you_mean(name, list(EXAMPLES))
        raise InputError(f"no example {name!r}; {near}there are: {', '.join(EXAMPLES)}")
    return name, Path(folder)


def _campaign() -> tuple[str, str]:
    """A campaign on a wheel that digs itself in with slip, which its model lacks."""
    from soilml.physics.effects import EFFECTS

    return MODEL, _text(_rows(MODEL, [EFFECTS["slip-sinkage"](n1=0.4)]))  # type: ignore[call-arg]


def _rover() -> tuple[str, str]:
    """A rover, and rows of one of its wheels."""
    return MODEL + ROVER, _text(_rows(MODEL, []))


def _rows(model: str, hidden: list[Any]) -> Table:
    """A campaign with noise, by a model to which hidden effects are added."""
    from dataclasses import replace

    import numpy as np

    from soilml.config.case import take_case
    from soilml.fitting.simulation import simulate
    from soilml.io.toml_settings import Settings
    from soilml.optional_imports import tomllib

    case = take_case(Settings(tomllib.loads(model), "example"))
    for effect in hidden:
        case = replace(case, model=case.model + effect)
    slip, load = np.tile(SLIPS, len(LOADS)), np.repeat(LOADS, len(SLIPS))
    names = np.repeat([f"load_{load:.0f}" for load in LOADS], len(SLIPS))
    return simulate(case, slip, load, run=names, seed=1)


def _text(rows: Table) -> str:
    from soilml.io.text_tables import csv_text

    return csv_text({name: rows[name] for name in MEASURED})


def _log() -> tuple[str, str]:
    """The recording of a rig under one load: a rest, then a stage at each slip."""
    import numpy as np

    from soilml.io.text_tables import csv_text

    rows = _rows(MODEL, []).where("load_N", "70")
    rng = np.random.default_rng(2)
    count = round(STAGE * RATE)
    stage = np.repeat(np.arange(len(SLIPS) + 1), count)
    moving = stage > 0

    def recorded(name: str, std: float) -> Any:
        values = np.concatenate([[0.0], rows[name]])[stage]
        return values + std * rng.standard_normal(stage.size)

    slip = np.concatenate([[0.0], rows["slip"]])[stage]
    columns = {
        "time [ms]": 1e3 * np.arange(stage.size) / RATE,
        "wheel speed [deg/s]": np.where(moving, np.degrees(0.05 / RADIUS), 0.0),
        "carriage speed [mm/s]": np.where(moving, 50.0 * (1.0 - slip), 0.0)
        + 0.1 * rng.standard_normal(stage.size),
        "torque [Nm]": recorded("torque_Nm", 0.05),
        "drawbar pull [N]": recorded("drawbar_pull_N", 0.3),
        "load [N]": 70.0 + 0.5 * rng.standard_normal(stage.size),
        "sinkage [mm]": 1e3 * recorded("sinkage_m", 2e-4),
    }
    text = csv_text({name: np.round(values, 4) for name, values in columns.items()})
    return MODEL, f"Radius: {1e3 * RADIUS:.0f} mm\n{text}"


def _sensor_wheel() -> tuple[str, str, str]:
    """Five turns of the wheel of Nagatani et al. 2009 on each of four slopes, k_x 7.2 mm."""
    import numpy as np

    from soilml.io.text_tables import csv_text
    from soilml.physics.soils import soil
    from soilml.systems.rim_stress import SensingWheel, SteadyRun, balanced_arc, simulate_readings

    wheel, sand = SensingWheel(), soil("nagatani2009/toyoura_sand")
    rng, runs = np.random.default_rng(4), {}
    readings: dict[str, list[Any]] = {"run": [], "angle_rad": [], "sensor": [], "force_N": []}
    for k, (slip, slope) in enumerate(((0.11, 0), (0.18, 2), (0.29, 4), (0.39, 6))):
        at = SteadyRun(slip=slip, weight=28.92, slope=np.deg2rad(slope))
        arc = balanced_arc(np.deg2rad(30.0), at, wheel, sand)
        found = simulate_readings(arc, wheel, turns=5, crown=0.3, lugs=(0.3, 0.3), seed=k)
        near = np.abs(found["angle_rad"]) < 1.0
        readings["run"] += [f"slope_{slope}"] * int(near.sum())
        for name, values in found.items():
            digits = 4 if name == "force_N" else 5
            readings[name] += values[near].round(digits).tolist()
        read = round(slip + 0.01 * (1.0 - slip) * float(rng.standard_normal()), 4)
        runs[f"slope_{slope}"] = (read, 0.01, 28.92, 0.3, round(float(at.slope), 5))
    names = ("slip", "slip_std", "load_N", "load_N_std", "slope_rad")
    table = dict(zip(names, zip(*runs.values(), strict=True), strict=True))
    return SENSOR_WHEEL, csv_text({"run": list(runs), **table}), csv_text(readings)


def _climb() -> tuple[str, str, str]:
    """Climbs of 0 and 4 degrees, and artificial slip on the flat."""
    import numpy as np

    from soilml.io.text_tables import csv_text
    from soilml.systems.rim_stress.simulation import SLOPES, SimulatedRover, climb_tables

    true, rng = SimulatedRover(), np.random.default_rng(4)
    climbs = true.simulate_climbs(rng, SLOPES[:2])
    tables = climb_tables(climbs, *true.simulate_artificial_slip(rng, repeats=2), rim_speed=0.00915)
    return CLIMB, csv_text(tables[0]), csv_text(tables[1])


def _wheel_leg() -> tuple[str]:
    """Strides on SSC-1 and ES-3 by the printed relations, with the errors of table VIII."""
    import numpy as np

    from soilml.io.text_tables import csv_text
    from soilml.systems.wheel_legs.stride_relations import (
        S_I,
        S_Z,
        SINKAGE_ERRORS,
        TORQUE,
        VIBRATION,
    )

    rng, columns = np.random.default_rng(4), dict[str, list[Any]]()
    errors = (TORQUE.errors, VIBRATION.errors, SINKAGE_ERRORS)
    for k, name, angle in ((0, "SSC-1", 0.7381), (3, "ES-3", 0.6254)):
        slip, noise = np.linspace(0.1, 0.4, 12), rng.standard_normal((3, 12))
        angles = [angle * (1.0 + 0.01 * own.friction[k]) for own in errors]
        read = []
        for relation, phi, z in zip((TORQUE, VIBRATION), angles, noise, strict=False):
            (p, q), (r, s) = relation.at_none, relation.rate
            y = (phi - relation.to_soil[0, 0]) / relation.to_soil[0, 1]
            read.append((slip + 0.03 * z - p - y * r) / (q + y * s))
        sunk = (angles[2] - S_I) / S_Z * (1.0 + 0.05 * noise[2])
        own = {"run": [name] * 12, "slip": slip, "torque_Nm": read[0], "vibration_m_s2": read[1]}
        for key, values in (own | {"sinkage_m": sunk}).items():
            cells = values if key == "run" else np.round(values, 4).tolist()
            columns.setdefault(key, []).extend(cells)
    return (csv_text(columns),)


def _track() -> tuple[str, str]:
    """Seven pulls of a tracked robot on sand, at 20 Hz."""
    import numpy as np

    from soilml.config.case import take_case
    from soilml.io.text_tables import csv_text
    from soilml.io.toml_settings import Settings
    from soilml.optional_imports import tomllib
    from soilml.systems.tracked_robot.track_log import simulate_log

    case = take_case(Settings(tomllib.loads(TRACK), "example"))
    slips = np.asarray([0.03, 0.08, 0.15, 0.25, 0.4, 0.6, 0.8])
    log = simulate_log(case, slips, 0.5 * 130.0 * 9.81, 0.6, np.random.default_rng(1))
    return TRACK, csv_text(
        {k: v if k == "run" else np.round(np.asarray(v, float), 5) for k, v in log.items()}
    )
