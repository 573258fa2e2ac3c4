"""`soilml gap`: where a model and measurements disagree, and what the model lacks."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from soilml.cli.effects_option import add_effects_option, chosen_effects
from soilml.config.case import read_case
from soilml.errors import InputError
from soilml.io.atomic_files import made_folder, replacing_all
from soilml.io.read_table import RUNS, read_table
from soilml.io.text_tables import aligned, csv_text
from soilml.optional_imports import need
from soilml.physics.effects.base import Effect

#: What the folder gets.
FILES = ("report.html", "gap.json", "model.toml", "next_runs.csv")

HELP = "find where a model and measured runs disagree, and name what is missing"
DESCRIPTION = """\
Compare MODEL.toml with measured runs, find where they disagree beyond noise and run-to-run scatter,
name the missing effect if the data can tell it from all others, add it, and show the gap shrink.

  soilml gap MODEL.toml RUNS.csv --out DIR
  soilml gap MODEL.toml RUNS.csv --out DIR --holdout run          a quarter of the runs kept back
  soilml gap MODEL.toml RUNS.csv --out DIR --holdout load_N=150   rows kept back by value

Rows of one run were driven on one bed (one load a run is best). Soil parameters without a prior are
held at the model's values: what is off in them looks like an effect.

RUNS.csv: run, slip, load_N, torque_Nm, and any of drawbar_pull_N, sinkage_m, speed_m_s (below zero
in reverse), pass, slip_angle_rad, time_s, <column>_std. DIR gets report.html (look at it first),
gap.json, model.toml (the model with what was added) and next_runs.csv (what to drive next).
Exit status is 0 whatever was found, 2 for bad input. A sensor that was checked can say so:
--checked torque-gain=0.003 gives the spread of its fault, in the unit that `soilml effects` shows.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", metavar="MODEL.toml")
    parser.add_argument("runs", metavar="RUNS.csv", help="measured rows, CSV or Parquet")
    parser.add_argument("--out", metavar="DIR", required=True, help="folder for the four files")
    parser.add_argument("--holdout", metavar="COLUMN=VALUE", help="rows kept back; or: run")
    parser.add_argument("--free", metavar="A,B,...", help="soil parameters that may differ")
    parser.add_argument("--seed", type=int, default=0, help="of all draws; 0 by default")
    parser.add_argument(
        "--checked",
        metavar="EFFECT=STD",
        action="append",
        default=[],
        help="spread of a sensor's fault after a check; may be given again",
    )
    parser.add_argument("--ignore-extra", action="store_true", help="pass over unknown columns")
    add_effects_option(parser)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes, where their folder is there already."""
    folder = Path(args.out)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {args.out} is a file; needed is a folder")
    return [folder / name for name in FILES] if folder.is_dir() else []


def run(args: argparse.Namespace) -> int:
    """Analyse and write the four files."""
    for library in ("scipy", "jinja2", "matplotlib"):
        need(library, "gap")
    from soilml.gap import gap
    from soilml.gap.search.updated_case import model_text

    if args.seed < 0:
        raise InputError(f"--seed is {args.seed}; needed is a whole number, 0 or more")
    effects = chosen_effects(args)
    case = read_case(args.model, effects)
    table = read_table(args.runs, RUNS, ignore_extra=args.ignore_extra)
    if sys.stderr.isatty():
        print(f"analysing {len(table)} rows ...", file=sys.stderr, flush=True)
    free = None if args.free is None else [name.strip() for name in args.free.split(",")]
    report = gap(
        case,
        table,
        free=free,
        holdout=args.holdout,
        effects=effects,
        calibration=_checked(args.checked, effects),
        seed=args.seed,
    )
    from soilml.gap.html.page import page

    texts = (
        page(report, str(args.model), str(args.runs)),
        json.dumps(_finite(report.as_json()), indent=2) + "\n",
        model_text(report.model, [report.sentence]),
        csv_text(_next_runs(report)),
    )
    with made_folder(args.out) as folder:
        names = [folder / name for name in FILES]
        with replacing_all(names) as parts:
            for part, text in zip(parts, texts, strict=True):
                part.write_text(text, encoding="utf-8")
    print(_for_people(report))
    print(f"\n{', '.join(str(name) for name in names)}", file=sys.stderr)
    return 0


def _checked(given: list[str], effects: dict[str, type[Effect]]) -> dict[str, float]:
    found = {}
    for text in given:
        name, _, value = text.partition("=")
        kinds = {n for n, e in effects.items() if e.about.kind in ("sensor", "rig")}
        if name not in kinds:
            names = ", ".join(sorted(kinds))
            raise InputError(f"--checked {text!r}: needed is EFFECT=STD, with one of {names}")
        try:
            found[name] = float(value)
        except ValueError:
            found[name] = 0.0
        if not 0.0 < found[name] < float("inf"):
            raise InputError(f"--checked {text!r}: the spread must be a number above zero")
    return found


def _next_runs(report: Any) -> dict[str, list[Any]]:
    """The suggested runs, a line for every operating point; checks have a line without one."""
    lines: list[dict[str, Any]] = []
    for number, option in enumerate(report.next_runs, 1):
        head = {"run": f"next_{number}", "kind": option.kind, "what": option.text}
        head["separates_sigma"] = option.separates
        lines += [head | row for row in option.rows or [{}]]
    names = ["run", "kind", "what", "separates_sigma", "slip", "load_N"]
    names += [name for line in lines for name in line if name not in names]
    return {name: [line.get(name, "") for line in lines] for name in dict.fromkeys(names)}


def _finite(value: Any) -> Any:
    """The same content with null for what is no number: JSON has none."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    if isinstance(value, float) and value - value != 0.0:
        return None
    return value


def _for_people(report: Any) -> str:
    parts = [f"{report.status}: {report.sentence}"]
    if report.gap:
        rows = [
            (name.replace("_", " "), f"{s.before:.3g}", f"{s.after:.3g}", s.what)
            for name, s in report.gap.items()
        ]
        parts.append(aligned(("gap", "before", "after", "rows"), rows, last_left=True))
    if report.effects:
        rows = [
            (f"{e.name} {k}", f"{v.value:.4g}", f"{v.std:.2g}", v.unit)
            for e in report.effects
            for k, v in e.parameters.items()
        ]
        parts.append(aligned(("effect", "value", "std", "unit"), rows))
    if report.next_runs:
        best = report.next_runs[0]
        apart = "10 sigma or more" if best.separates >= 10.0 else f"{best.separates:.2g} sigma"
        parts.append(f"next: {best.kind} ({best.text}): sets the explanations {apart} apart")
    parts += [f"! {note}" for note in report.notes]
    return "\n\n".join(parts)
