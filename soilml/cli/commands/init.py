"""`soilml init`: a first model file."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from soilml.cli.options import REQUIRED
from soilml.errors import InputError, did_you_mean

DESCRIPTION = """\
Write a model file to begin with: the wheel, a soil with wide priors, the noise
of the sensors, and the other sections as comments.

  soilml init MODEL.toml --radius 0.15 --width 0.12
  soilml init MODEL.toml --radius '15 cm' --width '120 mm' \\
      --soil wong1989/dry_sand

Without --soil the bearing of the soil is unknown too, and has a prior. An
existing file is not replaced.
"""
_FILE = """\
# Model file of soilml; docs/reference/model-file.md explains every section. SI units.

[gear]
type = "wheel"
radius = {radius} # m
width = {width} # m

[soil]
name = "{soil}" # {known}

[soil.prior]
cohesion = [{cohesion[0]}, {cohesion[1]}] # Pa
friction_angle = [{friction_angle[0]}, {friction_angle[1]}] # rad, {degrees}
shear_modulus = {{ range = [{shear_modulus[0]}, {shear_modulus[1]}], scale = "log" }} # m
{bearing}
[noise] # standard deviations of the sensors: of the reading, in its unit, or both
torque_Nm = "2 %"
# drawbar_pull_N = "2 % + 0.5"
# sinkage_m = 0.001
# slip = 0.01
# load_N = "1 %"

# [rover] # on several such wheels
# mass = 30.0 # kg
# centre_of_mass = [0.0, 0.0, 0.3] # m: forward, to the left, above the ground
# wheels.front-left = {{ position = [0.4, 0.3] }} # m: forward, to the left; one line for each

# [discrepancy] # typical error of the model, beyond the noise
# torque_Nm = "2 %"

# [[effect]] # see `soilml show effects`; `soilml gap` finds which are missing
# name = "slip-sinkage"
# n1 = 0.3
"""
_BEARING = """\
kphi = { range = [2e5, 5e6], scale = "log" } # N/m^(n+2): measure sinkage or pull too
n = [0.6, 1.4]
"""
#: Prior ranges of most soils; the value of --soil widens them.
_PRIORS = {
    "cohesion": (0.0, 5000.0),  # Pa
    "friction_angle": (0.35, 0.8),  # rad
    "shear_modulus": (0.003, 0.05),  # m
}
ARGUMENTS = (
    ("out MODEL.toml", "the file to write"),
    ("--radius M", "wheel radius in m, or such as '15 cm'", REQUIRED),
    ("--width M", "wheel width in m, or such as '120 mm'", REQUIRED),
    ("--soil PAPER/SOIL", "soil whose bearing is known; `soilml show soils` lists them"),
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return [Path(args.out)]


def run(args: argparse.Namespace) -> int:
    """Write the file."""
    from soilml.cli.output import show
    from soilml.config.case import take_case
    from soilml.io.atomic_files import save_text
    from soilml.io.toml_settings import Settings
    from soilml.optional_imports import tomllib

    file = Path(args.out)
    if file.exists():
        raise InputError(f"{file} exists; give another name, or remove it")
    text = _text(_size("radius", args.radius), _size("width", args.width), args.soil)
    take_case(Settings(tomllib.loads(text), str(file)))  # refuses a size that no wheel has
    save_text(file, text)
    show(f"{file} written. Next: soilml identify {file} RUNS.csv")
    return 0


def _size(key: str, text: str) -> float:
    """A size in m, from a number or a text with a unit."""
    from soilml.io.cell_text import read_number
    from soilml.io.declared_settings import text_in_si

    try:
        return read_number(text)
    except ValueError:
        return round(text_in_si(text, "m", f"--{key}"), 12)


def _text(radius: float, width: float, name: str | None) -> str:
    """The model file; without a soil the bearing of a start is unknown too."""
    from soilml.physics.soils import soil_catalogue

    catalogue = soil_catalogue()
    if name is not None and name not in catalogue:
        raise InputError(
            f"no soil {name!r}; {did_you_mean(name, catalogue)}`soilml show soils` lists them"
        )
    values = {} if name is None else {k: float(getattr(catalogue[name].soil, k)) for k in _PRIORS}
    ranges = {key: _range(*ends, values.get(key)) for key, ends in _PRIORS.items()}
    low, high = map(math.degrees, ranges["friction_angle"])
    return _FILE.format(
        radius=radius,
        width=width,
        soil=name or "wong1989/dry_sand",
        known="bearing as published; shear strength is identified"
        if name
        else "a start; what has a prior below is identified",
        degrees=f"{low:.0f} to {high:.0f} degrees",
        bearing="" if name else _BEARING,
        **ranges,
    )


def _range(low: float, high: float, value: float | None) -> tuple[float, float]:
    """The prior range of a parameter, which reaches beyond the published value."""
    from soilml.report.numbers import significant

    if value is None:
        return low, high
    low = low if value >= 1.1 * low else float(significant(0.5 * value, 2))
    return low, high if value <= 0.9 * high else float(significant(1.2 * value, 2))
