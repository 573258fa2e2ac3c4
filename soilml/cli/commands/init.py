"""`soilml init`: a first model file."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from soilml.cli.option_values import whole_number_from
from soilml.errors import InputError, did_you_mean
from soilml.io.atomic_files import save_text
from soilml.io.cell_text import is_number, read_number

DESCRIPTION = """\
Write a model file to begin with: the wheel, a soil with wide priors, the noise
of the sensors, and the other sections as comments.

  soilml init MODEL.toml                       asks a few questions on a terminal
  soilml init MODEL.toml --radius 0.15 --width 0.12 --soil wong1989/dry_sand
  soilml init MODEL.toml --radius 0.1 --width 0.08 --mass 12 --wheels 4 \\
      --wheelbase 0.4 --track 0.35 --height 0.18

Without --soil the bearing of the soil is unknown too, and has a prior. With
--mass the file describes a rover on --wheels wheels in two rows, over its
wheelbase and track, with the centre of mass above their middle at --height. An
existing file is not replaced.
"""
#: The question for each option that is asked for, and the default answer.
QUESTIONS = {
    "radius": ("wheel radius in m", ""),
    "width": ("wheel width in m", ""),
    "soil": ("soil whose bearing is known, such as wong1989/dry_sand; blank if unknown", ""),
    "torque_noise": ("standard deviation of torque, such as 2 % or 2 % + 0.05 (N m)", "2 %"),
}
#: Lengths that a rover has, and what each is.
LENGTHS = {
    "wheelbase": "distance of the first axle from the last",
    "track": "distance of the left wheels from the right ones",
    "height": "height of the centre of mass above the ground",
}


ARGUMENTS = (
    ("out MODEL.toml", "the file to write"),
    ("--radius M", "wheel radius in m, or such as '15 cm'"),
    ("--width M", "wheel width in m, or such as '120 mm'"),
    ("--soil PAPER/SOIL", "soil whose bearing is known; `soilml show soils` lists them"),
    ("--torque-noise NOISE", "std of torque, such as 0.05 (N m) or '2 %% + 0.05' (default: 2 %%)"),
    ("--mass KG", "mass of a rover in kg"),
    ("--wheels N", "its number of wheels (default: 4)", whole_number_from(2, 100)),
    *((f"--{name} M", f"its {text}, in m or such as '40 cm'") for name, text in LENGTHS.items()),
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return [Path(args.out)]


def run(args: argparse.Namespace) -> int:
    """Ask for what is missing on a terminal, and write the file."""
    from soilml.cli.output import show

    file = Path(args.out)
    if file.exists():
        raise InputError(f"{file} exists; give another name, or remove it")
    given = {key: getattr(args, key) for key in QUESTIONS}
    if sys.stdin.isatty() and sys.stdout.isatty() and given["radius"] is None:
        given = {key: value if value is not None else _ask(key) for key, value in given.items()}
    for key in ("radius", "width"):
        if given[key] is None:
            raise InputError(f"--{key} is missing; needed is the {QUESTIONS[key][0]}")
    sizes = {key: _size(key, str(given[key])) for key in ("radius", "width")}
    rover = None if args.mass is None else _rover(args)
    text = _text(given | sizes, rover)
    _check(text)
    save_text(file, text)
    show(f"{file} written. Next: soilml identify {file} RUNS.csv")
    return 0


def _ask(key: str) -> str | None:
    question, default = QUESTIONS[key]
    answer = input(f"{question}{f' [{default}]' if default else ''}: ").strip() or default
    return answer or None


def _size(key: str, text: str) -> float:
    """A size in SI units, from a number or a text with a unit."""
    from soilml.io.declared_settings import text_in_si

    try:
        return read_number(text)
    except ValueError:
        return round(text_in_si(text, "kg" if key == "mass" else "m", f"--{key}"), 12)


def _check(text: str) -> None:
    """Raise the error of a value that no model file may have, before anything is written."""
    import tempfile

    from soilml.config.case import read_case

    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder) / "model.toml"
        trial.write_text(text, encoding="utf-8")
        try:
            read_case(trial)
        except InputError as error:
            raise InputError(str(error).replace(f"{trial} ", "").replace(str(trial), "")) from None


def _text(given: dict[str, str | float | None], rover: str | None) -> str:
    """The model file."""
    from soilml.physics.soils import soil_catalogue

    name = given["soil"]
    catalogue = soil_catalogue()
    if name is not None and name not in catalogue:
        raise InputError(
            f"no soil {name!r}; {did_you_mean(str(name), catalogue)}`soilml show soils` lists them"
        )
    noise = str(given["torque_noise"] or "2 %")
    written = noise if is_number(noise) else f'"{noise}"'
    parts = [
        "# Model file of soilml; docs/reference/model-file.md explains every section. SI units.",
        f'[gear]\ntype = "wheel"\nradius = {given["radius"]} # m\nwidth = {given["width"]} # m',
        _soil(None if name is None else str(name)),
        "[noise] # standard deviations of the sensors: of the reading, in its unit, or both\n"
        f"torque_Nm = {written}\n"
        '# drawbar_pull_N = "2 % + 0.5"\n# sinkage_m = 0.001\n# slip = 0.01\n# load_N = "1 %"',
    ]
    if rover is not None:
        parts.append(rover)
    parts.append(
        "# [discrepancy] # typical error of the model, beyond the noise\n"
        '# torque_Nm = "2 %"\n\n'
        "# [[effect]] # see `soilml show effects`; `soilml gap` finds which are missing\n"
        '# name = "slip-sinkage"\n# n1 = 0.3'
    )
    return "\n\n".join(parts) + "\n"


def _soil(name: str | None) -> str:
    shear = (
        "cohesion = [0.0, 5000.0] # Pa\n"
        "friction_angle = [0.35, 0.80] # rad, 20 to 46 degrees\n"
        'shear_modulus = { range = [0.003, 0.05], scale = "log" } # m'
    )
    if name is not None:
        return (
            f'[soil]\nname = "{name}" # bearing as published; shear strength is identified\n\n'
            f"[soil.prior]\n{shear}"
        )
    return (
        '[soil]\nname = "wong1989/dry_sand" # a start; what has a prior below is identified\n\n'
        f"[soil.prior]\n{shear}\n"
        'kphi = { range = [2e5, 5e6], scale = "log" } # N/m^(n+2): measure sinkage or pull too\n'
        "n = [0.6, 1.4]"
    )


def _rover(args: argparse.Namespace) -> str:
    """The tables of the rover, of which no length is assumed."""
    mass, wheels = _size("mass", args.mass), 4 if args.wheels is None else args.wheels
    if wheels % 2:
        raise InputError(f"--wheels is {wheels}; needed is an even number, 2 or more")
    missing = [name for name in LENGTHS if getattr(args, name) is None]
    if missing:
        raise InputError(f"--{missing[0]} is missing; needed is the {LENGTHS[missing[0]]} in m")
    length, track, height = (_size(name, getattr(args, name)) for name in LENGTHS)
    rows = wheels // 2
    lines = [
        f"[rover]\nmass = {mass} # kg",
        f"centre_of_mass = [0.0, 0.0, {height}] # m: forward, to the left, above the ground",
        'gravity = "earth"\n\n[rover.wheels] # position in m: forward, to the left',
    ]
    for row in range(rows):
        x = 0.0 if rows == 1 else length * (0.5 - row / (rows - 1))
        for side, y in (("left", 0.5 * track), ("right", -0.5 * track)):
            lines.append(f"row{row + 1}-{side} = {{ position = [{x:g}, {y:g}] }}")
    return "\n".join(lines)
