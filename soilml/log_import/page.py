"""The page of an import: rows, what was left out and why, what looks odd, and the errors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from soilml.log_import.figures import run_figure, slip_figures
from soilml.log_import.result import ImportedLog
from soilml.optional_imports import need
from soilml.remarks import Remark
from soilml.report.numbers import format_number, format_with_std
from soilml.report.page import Provenance, Report, render

#: Most runs of which the page has a picture; the others are in the tables.
MOST_RUNS = 24
_SHOWN = (
    ("slip", "slip", 1.0, ""),
    ("load_N", "load", 1.0, "N"),
    ("torque_Nm", "torque", 1.0, "N m"),
    ("drawbar_pull_N", "drawbar pull", 1.0, "N"),
    ("sinkage_m", "sinkage", 1e3, "mm"),
)
_CONSTANTS = {
    "gain": "calibration, relative",
    "offset": "calibration, offset",
    "gear_ratio": "gear ratio",
    "efficiency": "efficiency of the gearbox",
    "torque_constant": "torque constant of the motor",
    "idle_current": "idle current",
    "mass": "mass",
    "wheelbase": "wheelbase",
    "behind_front": "place of the centre of mass",
    "height": "height of the centre of mass",
}
_UNITS = {"slip": "", "load": "N", "torque": "N m", "drawbar_pull": "N", "sinkage": "m"}


def page(
    imported: ImportedLog,
    progress: Callable[[str, int, int], None] | None = None,
    origin: Provenance | None = None,
) -> str:
    """The report as HTML.

    progress: Called with a stage, the pictures done and their number.
    origin: The command and its files; by default the call of `import_log` in Python.
    """
    for library in ("jinja2", "matplotlib"):
        need(library, "import")
    if origin is None:
        origin = Provenance.of(["import", *imported.sources, "--map", imported.map_name], [])
    shown = imported.series[:MOST_RUNS]
    pictures = []
    for i, series in enumerate(shown):
        if progress is not None:
            progress("drawing the report", i, len(shown))
        pictures.append({"series": series, "image": run_figure(series, imported.table)})
    if progress is not None:
        progress("drawing the report", len(shown), len(shown))
    return render(
        "import_page.html.j2",
        "soilml.log_import",
        "import",
        page=summary(imported),
        origin=origin,
        pictures=pictures,
        runs=len(imported.series),
        slip=slip_figures(imported.table, imported.radius),
        header=[(text, unit) for key, text, _, unit in _SHOWN if key in imported.table],
        rows=_rows(imported),
        left_out=_left_out(imported),
        shared=_shared(imported),
        bias_text=imported.bias_toml(),
    )


def summary(imported: ImportedLog) -> Report:
    """What every report says: question, verdict, what looks odd, what to do."""
    rows, runs = len(imported.table), imported.runs
    odd = (*imported.implausible, *imported.remarks)
    if imported.implausible:
        answer, tone = f"The map looks wrong: {odd[0].text}", "bad-data"
        step = "Correct the map, and import again."
    elif odd:
        answer, tone = odd[0].text, "suspected"
        step = "Look at the remarks and the pictures; then identify the soil from the rows."
    else:
        answer, tone = "Nothing looks odd.", "no-gap"
        step = "Identify the soil from the rows: soilml identify, or soilml gap."
    return Report(
        kind="import",
        title=f"Import report: {imported.map_name}",
        badge=f"{rows} row{'s'[: rows != 1]}",
        meaning=f"from {runs} run{'s'[: runs != 1]}; "
        + (
            f"{_kept_share(imported)} of the time is in steady windows"
            if imported.series
            else "each row of the table is a steady run"
        ),
        answer=[answer],
        tone=tone,
        warnings=odd[1:],
        next_steps=[step],
        notation=[("±", "one standard deviation, of what is independent from row to row.")],
    )


def _rows(imported: ImportedLog) -> list[dict[str, Any]]:
    table = imported.table
    rows = []
    for i in range(len(table)):
        cells = []
        for key, _, scale, _ in _SHOWN:
            if key not in table:
                continue
            value = scale * float(table[key][i])
            std = scale * float(table[f"{key}_std"][i]) if f"{key}_std" in table else np.nan
            cells.append(format_with_std(value, std) if np.isfinite(value) else "–")
        rows.append(
            {
                "run": str(table["run"][i]),
                "time": f"{table['time_s'][i]:.1f}" if "time_s" in table else "–",
                "cells": cells,
            }
        )
    return rows


def _left_out(imported: ImportedLog) -> list[dict[str, Any]]:
    """What is left out by run and reason, the longest first."""
    seconds: dict[tuple[str, Remark | None], list[tuple[float, float]]] = {}
    for run, s in imported.left_out():
        seconds.setdefault((run, s.why), []).append((s.start, s.stop))
    entries = [
        {
            "run": run,
            "why": why,
            "seconds": f"{sum(b - a for a, b in spans):.1f}",
            "spans": ", ".join(f"{a:.1f}–{b:.1f}" for a, b in spans[:4])
            + (", …" if len(spans) > 4 else ""),
        }
        for (run, why), spans in seconds.items()
    ]
    return sorted(entries, key=lambda e: -float(e["seconds"]))


def _shared(imported: ImportedLog) -> list[dict[str, str]]:
    found = []
    for part in sorted(imported.shared, key=lambda p: (p.quantity, -p.rms)):
        owner, _, name = part.constant.rpartition(".")
        text = _CONSTANTS.get(name, part.constant)
        if part.constant == "radius":
            text = "radius of the wheel"
        elif owner and owner != "vehicle":
            text = f"{text} of [{owner}]"
        quantity = part.quantity.replace("_", " ")
        size = f"{format_number(part.rms, 2)} {_UNITS[part.quantity]}".strip()
        found.append({"constant": text, "quantity": quantity, "size": size})
    return found


def _kept_share(imported: ImportedLog) -> str:
    total = sum(float(s.time[-1] - s.time[0]) for s in imported.series)
    kept = sum(w.stop - w.start for s in imported.series for w in s.stretches if not w.why)
    return f"{100.0 * kept / total:.0f} %" if total else "0 %"
