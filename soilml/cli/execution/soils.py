"""`soilml soils`: the catalogue of published soils."""

from __future__ import annotations

import argparse
import json
import math

from soilml.errors import InputError, did_you_mean
from soilml.io.text_tables import format_table
from soilml.parameters import declared
from soilml.physics.soils import Soil, SoilEntry, soil_catalogue


def run(args: argparse.Namespace) -> int:
    """Print the catalogue or one entry."""
    catalogue = soil_catalogue()
    if args.name is not None and args.name not in catalogue:
        raise InputError(
            f"no soil {args.name!r}; {did_you_mean(args.name, catalogue)}`soilml soils` lists them"
        )
    chosen = catalogue if args.name is None else {args.name: catalogue[args.name]}
    if args.json:
        print(json.dumps({name: _as_json(entry) for name, entry in chosen.items()}, indent=1))
    elif args.name is None:
        print(_list(list(chosen.values())))
    else:
        print(_one(catalogue[args.name]))
    return 0


def _value(entry: SoilEntry, field: str) -> str:
    value = getattr(entry.soil, field)
    return f"{value:.4g}{'*' if field in entry.assumed else ' '}"


def _list(entries: list[SoilEntry]) -> str:
    header = ("soil", "c Pa ", "phi deg ", "K mm ", "kc SI ", "kphi SI ", "n ", "what")
    rows = []
    for entry in entries:
        phi = math.degrees(entry.soil.friction_angle)
        k = 1e3 * entry.soil.shear_modulus
        marks = {f: "*" if f in entry.assumed else " " for f in declared(Soil)}
        rows.append(
            (
                entry.name,
                _value(entry, "cohesion"),
                f"{phi:.1f}{marks['friction_angle']}",
                f"{k:.3g}{marks['shear_modulus']}",
                _value(entry, "kc"),
                _value(entry, "kphi"),
                _value(entry, "n"),
                entry.text,
            )
        )
    notes = "* not printed in the paper: assumed, see the entry.  SI: N/m^(n+1), N/m^(n+2)."
    return f"{format_table(header, rows, last_left=True)}\n{notes}"


def _one(entry: SoilEntry) -> str:
    rows = []
    for name, parameter in declared(Soil).items():
        note = "assumed" if name in entry.assumed else "published"
        if name not in entry.assumed and name not in entry.published:
            note = "default"
        if entry.published.get(name, 0.0) < 0.0 == getattr(entry.soil, name):
            note = f"published as {entry.published[name]:g}: models use 0"
        value = getattr(entry.soil, name)
        rows.append((name, parameter.text, note, f"{value:.6g}", parameter.unit))
    table = format_table(("field", "what", "from", "value", "unit"), rows, text_columns=3)
    return f"{entry.name}: {entry.text}\n{entry.source}\n\n{table}"


def _as_json(entry: SoilEntry) -> dict[str, object]:
    values = {name: getattr(entry.soil, name) for name in declared(Soil)}
    return {"text": entry.text, "source": entry.source, "assumed": entry.assumed, "values": values}
