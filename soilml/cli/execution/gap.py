"""`soilml gap`: where a model and measurements disagree, and what the model lacks."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from soilml.cli.option_values import available_effects, check_seed, parse_costs, parse_names
from soilml.cli.output import json_text, show, tell
from soilml.cli.output_names import GAP_SUSPECTED
from soilml.cli.progress import progress_bar
from soilml.cli.reports.report_files import origin_of
from soilml.cli.table_reading import read_long_table
from soilml.cli.table_remarks import print_table_hints
from soilml.config.case import read_case
from soilml.config.sensor_bias import checked_sensors
from soilml.errors import InputError
from soilml.io.atomic_files import write_files
from soilml.io.cell_text import read_number
from soilml.io.read_table import RUNS
from soilml.io.text_tables import csv_text, format_table
from soilml.optional_imports import need
from soilml.physics.effects.base import Effect
from soilml.report.numbers import format_residual
from soilml.report.page import Provenance
from soilml.report.terminal import rounded, shown_unit, significant

if TYPE_CHECKING:
    from soilml.gap import GapReport


def run(args: argparse.Namespace) -> int:
    """Analyse and write the four files."""
    for library in ("scipy", "jinja2", "matplotlib"):
        need(library, "gap")
    from soilml.gap import gap

    check_seed(args)
    effects = available_effects(args)
    case = read_case(args.model, effects, with_bias=True)
    checked = checked_sensors(case.bias) | _calibration(args.checked, effects)
    case = replace(case, bias={})
    table = read_long_table(args.runs, RUNS, ignore_extra=args.ignore_extra)
    print_table_hints(table, case)
    with progress_bar(f"analysing {len(table)} rows", 100) as done:
        report = gap(
            case,
            table,
            free=parse_names(args.free),
            holdout=args.holdout,
            effects=effects,
            calibration=checked,
            costs=parse_costs(args),
            seed=args.seed,
            progress=lambda share: done(round(100 * share)),
        )
    texts = gap_files(report, str(args.model), str(args.runs), origin_of(args))
    folder = Path(args.out)
    # a suspected model of an earlier analysis would contradict this one
    earlier = [folder / GAP_SUSPECTED] if GAP_SUSPECTED not in texts else []
    files = {folder / name: text for name, text in texts.items()}
    write_files(files, folders=[folder], remove=earlier)
    show(_text(report))
    tell(f"\n{', '.join(str(name) for name in files)}")
    return 0


def gap_files(
    report: GapReport, model: str, runs: str, origin: Provenance | None = None
) -> dict[str, str]:
    """The content of the files of a report by their names; `model` and `runs` were analysed."""
    from soilml.config.write_case import case_as_toml
    from soilml.gap.html.page import page, summary

    if origin is None:
        origin = Provenance.of(["gap", model, runs], [])
    entry = {"report": summary(report, model, runs).as_json(origin)}
    texts = {
        "report.html": page(report, model, runs, origin),
        "gap.json": json_text(report.as_json() | entry),
        "model.toml": case_as_toml(report.model, [report.sentence]),
        "next_runs.csv": csv_text(_next_runs(report)),
    }
    if report.suspected_model is not None:
        first = " + ".join(report.best_unclaimed)
        heading = f"With {first}, which is suspected, not named. {report.sentence}"
        texts[GAP_SUSPECTED] = case_as_toml(report.suspected_model, [heading])
    return texts


def _calibration(texts: list[str], effects: dict[str, type[Effect]]) -> dict[str, float]:
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        kinds = {n for n, e in effects.items() if e.about.kind in ("sensor", "rig")}
        if name not in kinds:
            names = ", ".join(sorted(kinds))
            raise InputError(f"--checked {text!r}: needed is EFFECT=STD, with one of {names}")
        try:
            found[name] = read_number(value)
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


def _residual(x: float) -> str:
    return significant(x, 3) if not x < 1e-3 else format_residual(x)


def _gap_table(report: Any) -> str:
    rows = [
        (name.replace("_", " "), _residual(s.before), _residual(s.after), s.description)
        for name, s in report.gap.items()
    ]
    return format_table(("gap", "before", "after", "rows"), rows, last_left=True) if rows else ""


def _effect_table(report: Any) -> str:
    rows = [
        (f"{e.name} {k}", *_in_shown_unit(v.value, v.std, v.unit), f"{e.probability:.3f}")
        for e in report.effects
        for k, v in e.parameters.items()
    ]
    heading = ("effect", "value", "std", "unit", "probability")
    return format_table(heading, rows) if rows else ""


def _in_shown_unit(value: float, std: float, unit: str) -> tuple[str, str, str]:
    factor, shown = shown_unit(unit, value)
    return rounded(factor * value, factor * std), rounded(factor * std, factor * std), shown


def _both(d: Any) -> tuple[str, str, str]:
    """A discrepancy before and after, and their unit."""
    factor, shown = shown_unit(d.unit)
    return significant(factor * d.before_value, 3), significant(factor * d.after_value, 3), shown


def _suspect_table(report: Any) -> str:
    """The likeliest suspects, where no cause is named."""
    if report.status not in ("suspected", "unknown", "not-testable"):
        return ""
    rows = [(" + ".join(s.effects), f"{s.log_odds:+.1f}") for s in report.suspects[:5]]
    return format_table(("suspect", "ln(odds)"), rows) if rows else ""


def _discrepancy_table(report: Any) -> str:
    rows = [
        (name.rpartition("_")[0], *_both(d), f"{d.after_sigma:.2g}")
        for name, d in report.discrepancy.items()
    ]
    if not any(d.after_sigma > 0.0 for d in report.discrepancy.values()):
        return ""
    return format_table(("discrepancy (rms)", "before", "after", "unit", "sigma"), rows)
