"""The gap between model and measurements, with its map and the files of the report."""

from __future__ import annotations

from typing import Any

from soilml.gap import STATUSES, GapReport, gap
from soilml.gap.presentation import gap_files
from soilml.gap.report.page import (
    advice,
    conditions_text,
    discrepancy_maps,
    effect_descriptions,
    said,
    suspect_table,
)
from soilml.remarks import texts
from soilml.report.numbers import format_estimate, format_probability
from soilml.serve.answers.estimate import read_rows
from soilml.serve.answers.job_files import MODEL_FILE, Tell, page_case, write_files

_SHOWN_RUNS = 5  # Most next runs that the page shows; the report has all


def answer(request: dict[str, Any], tell: Tell) -> dict[str, Any]:
    """The verdict in words and tables, and the names of the written files.

    Raises `SoilmlError` as `soilml gap` does.
    """
    case = page_case(request)
    table = read_rows(request)
    stage = f"analysing {len(table)} rows"
    tell(stage, 0.0)
    report = gap(case, table, progress=lambda share: tell(stage, min(share, 1.0)))
    tell("drawing the report")
    files = gap_files(report, MODEL_FILE, table.source)
    return verdict(report) | {"rows": len(table), "files": write_files(files)}


def verdict(report: GapReport) -> dict[str, Any]:
    """The parts of a report that the page shows."""
    known, given = effect_descriptions(report), conditions_text(report.conditions)
    return {
        "status": report.status,
        "meaning": STATUSES.get(report.status, ""),
        "sentence": said(report)[0],
        "lines": said(report)[1:],
        "advice": advice(report),
        "reasons": texts(report.reasons),
        "causes": [[{"name": n, "text": known.get(n, "")} for n in names]
                   for names in report.cause_set],
        "effects": [
            {"name": e.name, "text": known.get(e.name, ""), "probability": e.probability,
             "parameters": [[k, format_estimate(v)] for k, v in e.parameters.items()]}
            for e in report.effects
        ],
        "suspects": [
            {"names": s["effects"], "probability": s["probability"], "given": given}
            for s in suspect_table(report)
        ],
        "maps": discrepancy_maps(report),
        "gap_probability": format_probability(report.gap_probability),
        "sizes": [
            {"rows": name, "before": g.before, "after": g.after, "what": g.description}
            for name, g in report.gap.items()
        ],
        "next_runs": [
            {"kind": n.kind, "text": n.text, "sigma": n.discrimination}
            for n in report.next_runs[:_SHOWN_RUNS]
        ],
        "notes": texts(report.notes),
    }  # fmt: skip
