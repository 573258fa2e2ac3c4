"""`soilml audit`: what a rig and a design could tell."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

from soilml.cli.effects_option import add_effects_option, chosen_effects
from soilml.config.case import read_case
from soilml.io.atomic_files import named, save_text
from soilml.io.read_table import read_table
from soilml.io.text_tables import aligned

if TYPE_CHECKING:
    from soilml.gap import Audit

HELP = "what these runs could name, before they are driven"
DESCRIPTION = """\
Say which missing effects the runs of DESIGN.csv could name with the sensors of MODEL.toml, which
they could not, and which run to add. Nothing measured is needed.

  soilml audit MODEL.toml DESIGN.csv
  soilml audit MODEL.toml DESIGN.csv --out audit.json

DESIGN.csv: run, slip, load_N, and speed_m_s, pass, slip_angle_rad where they are set. Channels are
those whose noise [noise] declares. `left` is the signal of an effect of its reference size, in
sigma, that the free soil parameters cannot absorb; `apart` what is left of it against its nearest
rival: an effect is nameable from about 3. `detectable` is the smallest size that is noticed in four
of five data sets.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", metavar="MODEL.toml")
    parser.add_argument("design", metavar="DESIGN.csv", help="planned rows, CSV or Parquet")
    parser.add_argument("--free", metavar="A,B,...", help="soil parameters that may differ")
    parser.add_argument("--out", metavar="FILE.json", help="where to write the audit")
    parser.add_argument("--ignore-extra", action="store_true", help="pass over unknown columns")
    add_effects_option(parser)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return named(args.out, ".json")


def run(args: argparse.Namespace) -> int:
    """Audit and print or write."""
    from soilml.gap import audit

    effects = chosen_effects(args)
    case = read_case(args.model, effects)
    design = read_table(args.design, ("run", "slip", "load_N"), ignore_extra=args.ignore_extra)
    free = None if args.free is None else [name.strip() for name in args.free.split(",")]
    found = audit(case, design, free=free, effects=effects)
    if args.out is not None:
        content = json.loads(json.dumps(found.as_json()).replace("Infinity", "null"))
        save_text(args.out, json.dumps(content, indent=2) + "\n")
    print(_for_people(found))
    return 0


def _for_people(found: Audit) -> str:
    rows = [
        (
            e.name,
            "yes" if e.separating_snr >= 3.0 else "no",
            f"{e.size:g} {e.unit}".removesuffix(" 1"),
            f"{e.left:.3g}",
            f"{e.separating_snr:.3g}",
            "never" if math.isinf(e.detectable) else f"{e.detectable:.2g}",
            f"{e.absorbed:.0%}",
            ", ".join(f"{name} {cosine:.2f}" for name, cosine in e.rivals[:2]),
        )
        for e in found.effects
    ]
    header = ("effect", "nameable", "size", "left", "apart", "detectable", "absorbed", "rivals")
    parts = [aligned(header, rows, text_columns=2, last_left=True)]
    if found.classes:
        parts.append(
            "at its reference size, the weaker of these looks like another of them:\n"
            + "\n".join("  " + ", ".join(c) for c in found.classes)
        )
    if found.untestable:
        lines = [f"  {name}: {why}" for name, why in found.untestable.items()]
        parts.append("cannot be tested:\n" + "\n".join(lines))
    gaining = [entry for entry in found.additions if entry[3]]
    lines = [f"  {kind} ({text}): {', '.join(gained)}" for kind, text, _, gained in gaining[:5]]
    parts.append(
        "runs to add, and what they would make nameable:\n" + ("\n".join(lines) or "  none")
    )
    return "\n\n".join(parts)
