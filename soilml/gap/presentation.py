"""The result of `gap` as text and as files, and the text of an audit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from soilml.io.text_tables import csv_text, format_table
from soilml.remarks import texts
from soilml.report.numbers import format_probability, format_residual
from soilml.report.page import Provenance, json_text
from soilml.report.terminal import rounded, shown_unit, significant

if TYPE_CHECKING:
    from soilml.gap.design.identifiability import Audit
    from soilml.gap.report.results import GapReport, RemainingDiscrepancy


def gap_files(
    report: GapReport, model_name: str, runs_name: str, origin: Provenance | None = None
) -> dict[str, str]:
    """The content of a report's files by their names.

    model_name, runs_name: Names of the analysed files.
    """
    from soilml.config.write_case import case_as_toml
    from soilml.gap.report.page import page, summary

    if origin is None:
        origin = Provenance.of(["gap", model_name, runs_name], [])
    entry = {"report": summary(report, model_name, runs_name).as_json(origin)}
    comments = [report.sentence]
    if count := len(report.model.explanations):
        comments += [
            f"{count} explanations with their weights follow; every prediction mixes them."
        ]
    return {
        "report.html": page(report, model_name, runs_name, origin),
        "gap.json": json_text(report.as_json() | entry),
        "model.toml": case_as_toml(report.model, comments),
        "next_runs.csv": csv_text(_next_runs(report)),
    }


def _next_runs(report: GapReport) -> dict[str, list[Any]]:
    """The suggested runs, one line for each operating point; a sensor check has one line."""
    lines: list[dict[str, Any]] = []
    for number, option in enumerate(report.next_runs, 1):
        head: dict[str, Any] = {"run": f"next_{number}", "kind": option.kind, "what": option.text}
        head["separates_sigma"] = option.discrimination
        if option.cost is not None:
            head["cost"] = option.cost
        lines += [head | row for row in option.rows or [{}]]
    names = ["run", "kind", "what", "separates_sigma"]
    names += ["cost"] if any("cost" in line for line in lines) else []
    names += ["slip", "load_N"]
    names += [name for line in lines for name in line if name not in names]
    return {name: [line.get(name, "") for line in lines] for name in dict.fromkeys(names)}


def gap_text(report: GapReport) -> str:
    """The verdict and its tables, for the terminal."""
    tables = (_gap_table, _effect_table, _suspect_table, _discrepancy_table)
    head = "\n".join([f"{report.status}: {report.sentence}", *texts(report.lines)])
    reasons = "\n".join(
        f"- {reason}" for reason in report.reasons if reason.text != report.sentence
    )
    parts = [head, reasons, *(table(report) for table in tables)]
    parts += [f"! {note}" for note in report.notes]
    return "\n\n".join(part for part in parts if part)


def _residual(x: float) -> str:
    return significant(x, 3) if not x < 1e-3 else format_residual(x)


def _gap_table(report: GapReport) -> str:
    changed = any(s.shrinks for s in report.gap.values())
    rows = []
    for name, s in report.gap.items():
        after = [_residual(s.after) if s.shrinks else "not smaller"] if changed else []
        rows.append((name.replace("_", " "), _residual(s.before), *after, s.description))
    head = ("gap", "before", "after", "rows") if changed else ("gap", "soil alone", "rows")
    return format_table(head, rows, last_left=True) if rows else ""


def _effect_table(report: GapReport) -> str:
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


def _left(d: RemainingDiscrepancy) -> tuple[str, str]:
    """A discrepancy that is left, and its unit."""
    factor, shown = shown_unit(d.unit)
    return significant(factor * d.after_value, 3), shown


def _suspect_table(report: GapReport) -> str:
    """The likeliest suspects, where no cause is named."""
    if report.status not in ("suspected", "unknown", "not-testable"):
        return ""
    rows = [
        (
            " + ".join(s.effects),
            format_probability(s.probability),
            f"{s.log_odds:+.1f}",
            s.prediction,
        )
        for s in report.suspects[:5]
    ]
    head = ("suspect", "probability", "ln(odds)", "ln(density kept back)")
    return format_table(head, rows) if rows else ""


def _discrepancy_table(report: GapReport) -> str:
    rows = [
        (name.rpartition("_")[0], *_left(d), f"{d.after_sigma:.2g}")
        for name, d in report.discrepancy.items()
    ]
    if not any(d.after_sigma > 0.0 for d in report.discrepancy.values()):
        return ""
    return format_table(("discrepancy left (rms)", "size", "unit", "sigma"), rows)


def audit_verdict(found: Audit) -> str:
    """How many effects these runs could name, and the run that would add most."""
    nameable = sum(e.nameable for e in found.effects)
    count = len(found.effects) + len(found.untestable)
    head = f"These runs could name {nameable} of {count} effects"
    gaining = [run for run in found.added_runs if run.gained]
    if not gaining:
        return f"{head}; no single run adds one."
    return f"{head}; add {gaining[0].kind.replace('_', ' ')} to name {len(gaining[0].gained)} more."


def audit_text(found: Audit, details: bool = False) -> str:
    """The verdict and the effects that can be named; with details, a line for each effect.

    With details also what cannot be distinguished or tested, and all runs to add.
    """
    if not details:
        named = [e.name for e in found.effects if e.nameable]
        runs = [run for run in found.added_runs if run.gained][:3]
        lines = [f"they could name: {', '.join(named)}"] if named else []
        lines += [f"add {run.kind} ({run.text}): {', '.join(run.gained)}" for run in runs]
        return "\n".join([audit_verdict(found), *lines, "details: -v, or --out FILE.json"])
    rows = [
        (
            e.name,
            "yes" if e.nameable else "no",
            f"{significant(factor * e.size)} {unit}".rstrip(),
            significant(e.residual_signal, 3),
            significant(e.separating_snr, 3),
            "never"
            if math.isinf(e.detectable_size)
            else significant(factor * e.detectable_size, 2),
            f"{e.absorbed:.0%}",
            ", ".join(f"{name} {cosine:.2f}" for name, cosine in e.rivals[:1]),
        )
        for e in found.effects
        for factor, unit in [shown_unit(e.unit)]
    ]
    header = ("effect", "nameable", "size", "left", "apart", "detectable", "absorbed", "rival")
    parts = [audit_verdict(found), format_table(header, rows, text_columns=2, last_left=True)]
    if found.classes:
        parts.append(
            "these effects cannot be distinguished at their reference sizes:\n"
            + "\n".join("  " + ", ".join(c) for c in found.classes)
        )
    if found.untestable:
        lines = [f"  {name}: {why}" for name, why in found.untestable.items()]
        parts.append("cannot be tested:\n" + "\n".join(lines))
    gaining = [run for run in found.added_runs if run.gained]
    lines = [f"  {run.kind} ({run.text}): {', '.join(run.gained)}" for run in gaining[:5]]
    parts.append(
        "runs to add, and the effects that could then be named:\n" + ("\n".join(lines) or "  none")
    )
    return "\n\n".join(parts)
