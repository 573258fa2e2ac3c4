"""The report as one self-contained page."""

from __future__ import annotations

from soilml.gap.report import GapReport


def page(report: GapReport, model: str, runs: str) -> str:
    """The report as HTML; `model` and `runs` name the files that were analysed."""
    return f"<html><body>{report.sentence} {model} {runs}</body></html>"
