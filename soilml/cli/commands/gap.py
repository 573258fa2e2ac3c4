"""`soilml gap`: where a model and measurements disagree, and what the model lacks."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from soilml.cli.options import (
    InputFile,
    add_cost_option,
    add_effects_option,
    add_ignore_extra_option,
    add_seed_option,
    available_effects,
    check_seed,
    parse_costs,
    parse_names,
)
from soilml.cli.output import json_text
from soilml.cli.progress import progress_bar
from soilml.config.case import read_case
from soilml.errors import InputError
from soilml.io.atomic_files import atomic_outputs, create_folder
from soilml.io.read_table import RUNS, read_table
from soilml.io.text_tables import csv_text, format_table
from soilml.optional_imports import need
from soilml.physics.effects.base import Effect

#: Files that the output folder receives.
FILES = ("report.html", "gap.json", "model.toml", "next_runs.csv")
#: A further file where causes are suspected but not named: the model with the first suspect.
SUSPECTED = "model_suspected.toml"

HELP = "find where a model and measured runs disagree, and name the missing effect"
DESCRIPTION = """\
Compare MODEL.toml with measured runs. Where they disagree by more than noise
and run-to-run scatter, search for the missing effect, name it if the data
distinguish it from all others, add it to the model, and report how much of the
gap it closes.

  soilml gap MODEL.toml RUNS.csv --out DIR
  soilml gap MODEL.toml RUNS.csv --out DIR --holdout run
  soilml gap MODEL.toml RUNS.csv --out DIR --holdout load_N=150

--holdout keeps a quarter of the runs, or the rows with this value, for
validation. All rows of a run must come from one soil bed; one load per run is
best. Soil parameters without a prior are fixed at the model's values, and an
error in them appears as an effect.

RUNS.csv has the columns run, slip, load_N, torque_Nm, and optionally
drawbar_pull_N, sinkage_m, speed_m_s (below zero in reverse), pass,
slip_angle_rad, time_s and <column>_std. DIR receives report.html (start here),
gap.json, model.toml (the model with the effects that the evidence supports) and
next_runs.csv (runs to measure next); and model_suspected.toml where causes are
suspected but not named. The exit status is 0 whatever the result and 2 for bad
input.

Runs of several wheels on one soil: write each as [gears.NAME] in MODEL.toml,
and name it in the column gear. An effect of one wheel is then grousers@NAME.

--checked torque-gain=0.003 declares the standard deviation of a sensor's fault
after calibration, in the unit that `soilml effects` lists. --cost second-pass=3
gives the cost of a kind of run in next_runs.csv, in any unit; runs are then
ranked by what they discriminate per cost.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "model", type=InputFile, metavar="MODEL.toml", help="gear, soil, priors and noise"
    )
    parser.add_argument(
        "runs", type=InputFile, metavar="RUNS.csv", help="measured rows, CSV or Parquet"
    )
    parser.add_argument("--out", metavar="DIR", required=True, help="folder for the four files")
    parser.add_argument(
        "--holdout",
        metavar="COLUMN=VALUE",
        help="rows held out for validation, or `run` for a quarter of the runs",
    )
    parser.add_argument(
        "--free", metavar="A,B,...", help="soil parameters to fit (default: those with a prior)"
    )
    add_seed_option(parser)
    parser.add_argument(
        "--checked",
        metavar="EFFECT=STD",
        action="append",
        default=[],
        help="standard deviation of a sensor's fault after calibration; can be repeated",
    )
    add_cost_option(parser)
    add_ignore_extra_option(parser)
    add_effects_option(parser)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes, where their folder exists already."""
    folder = Path(args.out)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {args.out} is a file; needed is a folder")
    return [folder / name for name in (*FILES, SUSPECTED)] if folder.is_dir() else []


def run(args: argparse.Namespace) -> int:
    """Analyse and write the four files."""
    for library in ("scipy", "jinja2", "matplotlib"):
        need(library, "gap")
    from soilml.config.write_case import case_as_toml
    from soilml.gap import gap

    check_seed(args)
    effects = available_effects(args)
    case = read_case(args.model, effects)
    table = read_table(args.runs, RUNS, ignore_extra=args.ignore_extra)
    with progress_bar(f"analysing {len(table)} rows", 100) as done:
        report = gap(
            case,
            table,
            free=parse_names(args.free),
            holdout=args.holdout,
            effects=effects,
            calibration=_calibration(args.checked, effects),
            costs=parse_costs(args),
            seed=args.seed,
            progress=lambda share: done(round(100 * share)),
        )
    from soilml.gap.html.page import page

    texts = {
        "report.html": page(report, str(args.model), str(args.runs)),
        "gap.json": json_text(report.as_json()),
        "model.toml": case_as_toml(report.model, [report.sentence]),
        "next_runs.csv": csv_text(_next_runs(report)),
    }
    if report.suspected_model is not None:
        first = " + ".join(report.best_unclaimed)
        heading = f"With {first}, which is suspected, not named. {report.sentence}"
        texts[SUSPECTED] = case_as_toml(report.suspected_model, [heading])
    with create_folder(args.out) as folder:
        names = [folder / name for name in texts]
        with atomic_outputs(names) as parts:
            for part, text in zip(parts, texts.values(), strict=True):
                part.write_text(text, encoding="utf-8")
        if SUSPECTED not in texts:  # one of an earlier analysis would contradict this one
            (folder / SUSPECTED).unlink(missing_ok=True)
    print(_text(report))
    print(f"\n{', '.join(str(name) for name in names)}", file=sys.stderr)
    return 0


def _calibration(texts: list[str], effects: dict[str, type[Effect]]) -> dict[str, float]:
    found = {}
    for text in texts:
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
            raise InputError(
                f"--checked {text!r}: the standard deviation must be a number above zero"
            )
    return found


def _next_runs(report: Any) -> dict[str, list[Any]]:
    """The suggested runs, one line for each operating point; a sensor check has one line."""
    lines: list[dict[str, Any]] = []
    for number, option in enumerate(report.next_runs, 1):
        head = {"run": f"next_{number}", "kind": option.kind, "what": option.text}
        head["separates_sigma"] = option.discrimination
        if option.cost is not None:
            head["cost"] = option.cost
        lines += [head | row for row in option.rows or [{}]]
    names = ["run", "kind", "what", "separates_sigma"]
    names += ["cost"] if any("cost" in line for line in lines) else []
    names += ["slip", "load_N"]
    names += [name for line in lines for name in line if name not in names]
    return {name: [line.get(name, "") for line in lines] for name in dict.fromkeys(names)}


def _text(report: Any) -> str:
    """The verdict and its tables, for the terminal."""
    tables = (_gap_table, _effect_table, _suspect_table, _discrepancy_table)
    parts = [f"{report.status}: {report.sentence}", *(table(report) for table in tables)]
    if report.next_runs:
        best = report.next_runs[0]
        apart = (
            "10 sigma or more"
            if best.discrimination >= 10.0
            else f"{best.discrimination:.2g} sigma"
        )
        cost = "" if best.cost is None else f" at a cost of {best.cost:g}"
        parts.append(f"next: {best.kind} ({best.text}); expected discrimination: {apart}{cost}")
    parts += [f"! {note}" for note in report.notes]
    return "\n\n".join(part for part in parts if part)


def _gap_table(report: Any) -> str:
    rows = [
        (name.replace("_", " "), f"{s.before:.3g}", f"{s.after:.3g}", s.description)
        for name, s in report.gap.items()
    ]
    return format_table(("gap", "before", "after", "rows"), rows, last_left=True) if rows else ""


def _effect_table(report: Any) -> str:
    rows = [
        (f"{e.name} {k}", f"{v.value:.4g}", f"{v.std:.2g}", v.unit, f"{e.probability:.3f}")
        for e in report.effects
        for k, v in e.parameters.items()
    ]
    heading = ("effect", "value", "std", "unit", "probability")
    return format_table(heading, rows) if rows else ""


def _suspect_table(report: Any) -> str:
    """The likeliest suspects, where no cause is named."""
    if report.status not in ("suspected", "unknown", "not-testable"):
        return ""
    rows = [(" + ".join(s.effects), f"{s.log_odds:+.1f}") for s in report.suspects[:5]]
    return format_table(("suspect", "ln(odds)"), rows) if rows else ""


def _discrepancy_table(report: Any) -> str:
    rows = [
        (name, f"{d.before_value:.3g}", f"{d.after_value:.3g}", d.unit, f"{d.after_sigma:.2g}")
        for name, d in report.discrepancy.items()
    ]
    if not any(d.after_sigma > 0.0 for d in report.discrepancy.values()):
        return ""
    return format_table(("discrepancy (rms)", "before", "after", "unit", "sigma"), rows)
