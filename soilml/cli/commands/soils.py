"""`soilml show soils`: the catalogue of published soils."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from soilml.cli.options import OPTIONAL
from soilml.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from soilml.physics.soils import SoilEntry

FORMATS = ("table", "json")
DESCRIPTION = """\
List the catalogue of published soils. Values are in SI units; * marks a value
that is not printed in the paper and is assumed.

  soilml show soils                      all soils, one line each
  soilml show soils wong1989/dry_sand    one soil, its source and all values
"""
ARGUMENTS = (("name", "PAPER/SOIL, the name of the soil to show", OPTIONAL),)


def run(args: argparse.Namespace) -> int:
    """Print the catalogue or one entry."""
    from soilml.physics.soils import soil_catalogue

    catalogue = soil_catalogue()
    if args.name is not None and args.name not in catalogue:
        raise InputError(
            f"no soil {args.name!r}; {did_you_mean(args.name, catalogue)}"
            "`soilml show soils` lists them"
        )
    chosen = catalogue if args.name is None else {args.name: catalogue[args.name]}
    if args.format == "json":
        print(json.dumps({name: _as_json(entry) for name, entry in chosen.items()}, indent=1))
    elif args.name is None:
        print(_list(list(chosen.values())))
    else:
        print(_one(catalogue[args.name]))
    return 0


def _list(entries: list[SoilEntry]) -> str:
    from soilml.report.aligned_text import format_table

    header = ("soil", "c ", "phi ", "K ", "n ", "what")
    rows = []
    for entry in entries:
        values = (
            f"{_text(entry, field)}{'*' if field in entry.assumed else ' '}"
            for field in ("cohesion", "friction_angle", "shear_modulus", "n")
        )
        rows.append((entry.name, *values, entry.text))
    notes = (
        "c in kPa, phi in degrees, K in mm; * not in the paper: assumed.\n"
        "`soilml show soils NAME` has kc, kphi, and the source."
    )
    return f"{format_table(header, rows, last_left=True)}\n{notes}"


def _text(entry: SoilEntry, field: str) -> str:
    """The value of a parameter in the unit of a terminal."""
    from soilml.parameters import declared
    from soilml.physics.soils import Soil
    from soilml.report.numbers import shown_unit, significant

    value = float(getattr(entry.soil, field))
    return significant(shown_unit(declared(Soil)[field].unit, value)[0] * value)


def _one(entry: SoilEntry) -> str:
    from soilml.parameters import declared
    from soilml.physics.soils import Soil
    from soilml.report.aligned_text import format_table
    from soilml.report.numbers import shown_unit, significant

    rows = []
    for name, parameter in declared(Soil).items():
        note = "assumed" if name in entry.assumed else "published"
        if name not in entry.assumed and name not in entry.published:
            note = "default"
        if entry.published.get(name, 0.0) < 0.0 == getattr(entry.soil, name):
            note = f"published as {entry.published[name]:g}: models use 0"
        factor, unit = shown_unit(parameter.unit, float(getattr(entry.soil, name)))
        if name in entry.spread:
            low, high = (significant(factor * end) for end in entry.spread[name])
            note = f"published, {low} to {high}"
        rows.append((name, parameter.text, note, _text(entry, name), unit))
    table = format_table(("field", "what", "from", "value", "unit"), rows, text_columns=3)
    return f"{entry.name}: {entry.text}\n{entry.source}\n\n{table}"


def _as_json(entry: SoilEntry) -> dict[str, object]:
    from soilml.parameters import declared
    from soilml.physics.soils import Soil

    values = {name: getattr(entry.soil, name) for name in declared(Soil)}
    return {
        "text": entry.text,
        "source": entry.source,
        "assumed": entry.assumed,
        "values": values,
        "ranges": entry.spread,
    }
