"""The report as one self-contained HTML page.

A section consists of a template `section_NAME.html.j2`, which `gap_page.html.j2` includes,
and, where it needs more than the report itself, a builder in a module of that name; `_content`
calls it.
"""

from __future__ import annotations

import math
from typing import Any

from soilml.gap.html.discrepancy_map import discrepancy_maps
from soilml.gap.html.gap_bars import gap_bars
from soilml.gap.html.prediction_curves import prediction_curves
from soilml.gap.html.soil_table import soil_table, soil_test_table
from soilml.gap.html.verdict_section import (
    advice,
    effect_descriptions,
    effect_tables,
    model_after,
    suspect_table,
)
from soilml.gap.results import STATUSES, GapReport
from soilml.optional_imports import need
from soilml.report import numbers
from soilml.report.page import Provenance, Report, render


def page(report: GapReport, model: str, runs: str, origin: Provenance | None = None) -> str:
    """The report as HTML.

    Parameters
    ----------
    model, runs : str
        Names of the analysed files.
    origin : Provenance, optional
        The command and its files; by default the call of `soilml.gap.gap` in Python.
    """
    for library in ("jinja2", "matplotlib"):
        need(library, "gap")
    if origin is None:
        origin = Provenance.of(["gap", model, runs], [])
    content = {"page": summary(report, model, runs), "origin": origin, **_content(report)}
    return render("gap_page.html.j2", "soilml.gap.html", "gap", **content)


def summary(report: GapReport, model: str, runs: str) -> Report:
    """What every report says: question, verdict, warnings, what to do."""
    notation = []
    if report.gap:
        notation = [
            (
                "Gap",
                "mean of ((measured − predicted) / σ)², where σ is the standard deviation of the "
                "reading from sensor noise and run-to-run variation; noise alone gives 1. A "
                "prediction without equilibrium counts as 10 σ off.",
            ),
            (
                "Held out",
                "both models are refitted without the runs, or the region, that they then predict, "
                "unless rows were held out by --holdout.",
            ),
            ("σ, ±", "one standard deviation."),
        ]
    sentence = report.sentence.replace(" -> ", " → ")
    return Report(
        kind="gap",
        title=f"Gap report: {model} against {runs}",
        badge=report.status,
        meaning=STATUSES.get(report.status, ""),
        answer=[f"No analysis: {sentence}" if report.status == "bad-data" else sentence],
        tone=report.status,
        warnings=report.notes,
        next_steps=[text] if (text := advice(report)) else [],
        notation=notation,
    )


def _content(report: GapReport) -> dict[str, Any]:
    """The variables of the templates, section by section."""
    changed = any(s.before != s.after for s in report.gap.values())
    components = report.variance_components.items()
    return {
        "report": report,
        "finite": math.isfinite,
        "changed": changed,
        "reasons": report.reasons or (report.sentence,),
        "after": model_after(report),
        "known": effect_descriptions(report),
        "bars": gap_bars(report, changed),
        "causes": effect_tables(report),
        "maps": discrepancy_maps(report),
        "curves": report.curves and prediction_curves(report.curves, changed),
        "soil": soil_table(report),
        "soil_tests": soil_test_table(report),
        "soil_changed": report.soil_before != report.soil_after,
        "suspects": suspect_table(report),
        "variance_components": [
            numbers.format_variance_component(key, value) for key, value in components
        ],
    }
