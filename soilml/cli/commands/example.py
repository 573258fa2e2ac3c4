"""`soilml example`: files to try the commands with."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from soilml.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from soilml.io.table import Table

DESCRIPTION = """\
Write an example into a folder, and say which command to run on it.

  soilml example FOLDER               a campaign whose wheel does what its model lacks
  soilml example log FOLDER           the recording of a rig, in the units of its maker
  soilml example rover FOLDER         a rover, and rows of one of its wheels

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
    "campaign": (
        ("model.toml", "runs.csv"),
        "soilml gap {0}/model.toml {0}/runs.csv --out {0}/gap",
    ),
    "log": (
        ("model.toml", "rig.csv"),
        "soilml import --init {0}/rig.csv --out {0}/map.toml",
    ),
    "rover": (
        ("rover.toml", "runs.csv"),
        "soilml pull {0}/rover.toml {0}/runs.csv --slope 0,10,20",
    ),
}
LOADS = (40.0, 55.0, 70.0, 85.0, 100.0, 115.0)  # N
SLIPS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
MEASURED = ("run", "slip", "load_N", "torque_Nm", "drawbar_pull_N", "sinkage_m")
RATE, STAGE, RADIUS = 50.0, 6.0, 0.15  # Rows a second, seconds at each slip, m


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "words",
        nargs="+",
        metavar="[NAME] FOLDER",
        help=f"{', '.join(EXAMPLES)} (default: campaign), and the folder for its files",
    )


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    from soilml.cli.options import folder_outputs

    name, folder = _name_and_folder(args)
    return folder_outputs("FOLDER", str(folder), EXAMPLES[name][0])


def run(args: argparse.Namespace) -> int:
    """Write the files, and say what to do next."""
    from soilml.cli.output import show
    from soilml.io.atomic_files import write_files
    from soilml.optional_imports import need

    need("scipy", "example")
    name, folder = _name_and_folder(args)
    files = [folder / file for file in EXAMPLES[name][0]]
    taken = [str(file) for file in files if file.exists()]
    if taken:
        raise InputError(f"{taken[0]} exists; give another folder")
    texts = {"campaign": _campaign, "log": _log, "rover": _rover}[name]()
    write_files(dict(zip(files, texts, strict=True)), folders=[folder])
    show(f"{', '.join(map(str, files))} written. Next: {EXAMPLES[name][1].format(folder)}")
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
