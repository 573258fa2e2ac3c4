"""`soilml init`: a first model file."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from soilml.cli.option_values import whole_number_from
from soilml.errors import InputError, did_you_mean
from soilml.io.atomic_files import save_text
from soilml.io.cell_text import is_number, read_number
from soilml.report.numbers import significant

if TYPE_CHECKING:
    from soilml.physics.soils import SoilEntry

DESCRIPTION = """\
Write a model file to begin with: the wheel, a soil with wide priors, the noise
of the sensors, and the other sections as comments.

  soilml init MODEL.toml --radius 0.15 --width 0.12 --soil wong1989/dry_sand
  soilml init MODEL.toml --radius 0.1 --width 0.08 --mass 12 --wheels 4 \\
      --wheelbase 0.4 --track 0.35 --height 0.18

Without --soil the bearing of the soil is unknown too, and has a prior. With
--mass the file describes a rover on --wheels wheels in two rows, over its
wheelbase and track, with the centre of mass above their middle at --height. An
existing file is not replaced.
"""
#: Lengths that a rover has, and what each is.
LENGTHS = {
    "wheelbase": "distance of the first axle from the last",
    "track": "distance of the left wheels from the right ones",
    "height": "height of the centre of mass above the ground",
}
#: Prior ranges of most soils; the value of --soil widens them.
_PRIORS = {
    "cohesion": (0.0, 5000.0),  # Pa
    "friction_angle": (0.35, 0.8),  # rad
    "shear_modulus": (0.003, 0.05),  # m
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
    for key in ("radius", "width"):
        if getattr(args, key) is None:
            raise InputError(f"--{key} is missing; needed is the wheel {key} in m")
    sizes = {key: _size(key, getattr(args, key)) for key in ("radius", "width")}
    rover = None if args.mass is None else _rover(args)
    text = _text(sizes, args.soil, args.torque_noise or "2 %", rover)
    _check(text)
    save_text(file, text)
    show(f"{file} written. Next: soilml identify {file} RUNS.csv")
    return 0


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


def _text(sizes: dict[str, float], name: str | None, noise: str, rover: str | None) -> str:
    """The model file."""
    from soilml.physics.soils import soil_catalogue

    catalogue = soil_catalogue()
    if name is not None and name not in catalogue:
        raise InputError(
            f"no soil {name!r}; {did_you_mean(name, catalogue)}`soilml show soils` lists them"
        )
    written = noise if is_number(noise) else f'"{noise}"'
    parts = [
        "# Model file of soilml; docs/reference/model-file.md explains every section. SI units.",
        f'[gear]\ntype = "wheel"\nradius = {sizes["radius"]} # m\nwidth = {sizes["width"]} # m',
        _soil(None if name is None else catalogue[name]),
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


def _soil(soil: SoilEntry | None) -> str:
    """The tables of the soil; without one, the bearing of a start is unknown too."""
    ranges = {name: _range(name, soil) for name in _PRIORS}
    low, high = ranges["friction_angle"]
    shear = (
        f"cohesion = {list(ranges['cohesion'])} # Pa\n"
        f"friction_angle = {[low, high]} # rad, {math.degrees(low):.0f} to "
        f"{math.degrees(high):.0f} degrees\n"
        f'shear_modulus = {{ range = {list(ranges["shear_modulus"])}, scale = "log" }} # m'
    )
    if soil is not None:
        return (
            f'[soil]\nname = "{soil.name}" # bearing as published; shear strength is identified\n\n'
            f"[soil.prior]\n{shear}"
        )
    return (
        '[soil]\nname = "wong1989/dry_sand" # a start; what has a prior below is identified\n\n'
        f"[soil.prior]\n{shear}\n"
        'kphi = { range = [2e5, 5e6], scale = "log" } # N/m^(n+2): measure sinkage or pull too\n'
        "n = [0.6, 1.4]"
    )


def _range(name: str, soil: SoilEntry | None) -> tuple[float, float]:
    """The prior range of a parameter, which reaches beyond the published value."""
    low, high = _PRIORS[name]
    if soil is None:
        return low, high
    value = float(getattr(soil.soil, name))
    low = low if value >= 1.1 * low else float(significant(0.5 * value, 2))
    return low, high if value <= 0.9 * high else float(significant(1.2 * value, 2))


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
