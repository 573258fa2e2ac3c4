"""The report as one self-contained HTML page.

A section consists of a template `section_NAME.html.j2`, which `page.html.j2` includes, and, where
it needs more than the report itself, a builder in a module of that name; `_content` calls it.
"""

from __future__ import annotations

import math
from typing import Any

from soilml.gap.html import formatting
from soilml.gap.html.discrepancy_map import discrepancy_maps
from soilml.gap.html.gap_bars import gap_bars
from soilml.gap.html.prediction_curves import prediction_curves
from soilml.gap.html.soil_table import soil_table
from soilml.gap.html.verdict_section import (
    advice,
    effect_descriptions,
    effect_tables,
    model_after,
    suspect_table,
)
from soilml.gap.results import STATUSES, GapReport
from soilml.optional_imports import need


def page(report: GapReport, model: str, runs: str) -> str:
    """The report as HTML.

    Parameters
    ----------
    model, runs : str
        Names of the analysed files.
    """
    for library in ("jinja2", "matplotlib"):
        need(library, "gap")
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("soilml.gap", "html"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "figure": formatting.format_number,
        "chance": formatting.format_p_value,
        "channel": formatting.channel_name,
        "gain": formatting.format_gain,
    }
    template = environment.get_template("page.html.j2")
    return template.render(model=model, runs=runs, **_content(report))


def _content(report: GapReport) -> dict[str, Any]:
    """The variables of the templates, section by section."""
    from soilml import __version__

    changed = any(s.before != s.after for s in report.gap.values())
    components = report.variance_components.items()
    return {
        "report": report,
        "version": __version__,
        "finite": math.isfinite,
        "changed": changed,
        "sentence": report.sentence.replace(" -> ", " → "),
        "meaning": STATUSES.get(report.status, ""),
        "advice": advice(report),
        "reasons": report.reasons or (report.sentence,),
        "after": model_after(report),
        "known": effect_descriptions(report),
        "bars": gap_bars(report, changed),
        "causes": effect_tables(report),
        "maps": discrepancy_maps(report),
        "curves": report.curves and prediction_curves(report.curves, changed),
        "soil": soil_table(report),
        "soil_changed": report.soil_before != report.soil_after,
        "suspects": suspect_table(report),
        "variance_components": [
            formatting.format_variance_component(key, value) for key, value in components
        ],
    }
