"""Dropped files: tables of runs, which are checked as commands do, and raw logs with their map."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from soilml.io.read_table import RUNS, read_table
from soilml.io.spreadsheet import is_spreadsheet, sheet_rows, sheets_with_cells, split_sheet
from soilml.io.table import Table
from soilml.io.text_tables import csv_text
from soilml.log_import.checks.table_hints import table_remarks
from soilml.log_import.workflow import import_log
from soilml.quantities import COLUMNS
from soilml.remarks import texts
from soilml.report.page import Provenance, json_text, page
from soilml.serve.answers.job_files import Tell, setting_file, write_files

RUNS_FILE = "runs.csv"  # The table that an import writes
#: Columns by two of which a table of runs is known, and rows that are drawn.
_KNOWN, _DRAWN = {*RUNS, "drawbar_pull_N", "sinkage_m"}, 2000


def look(request: dict[str, Any], tell: Tell) -> dict[str, Any]:
    """The kind of a file, and of a table of runs its content; of a spreadsheet its sheets.

    Raises `TableError` for the first fault of a table.
    """
    names = request["names"]
    tell(f"reading {names[0]}")
    file, sheet = split_sheet(names[0])
    if is_spreadsheet(file) and not sheet:
        sheets = sheets_with_cells(file)
        if len(sheets) > 1:
            return {"kind": "sheets", "sheets": sheets}
    if len(names) > 1 or not is_table_of_runs(Path(names[0])):
        return {"kind": "log"}
    table = read_table(names[0], RUNS)
    return {"kind": "runs", **table_summary(table), "remarks": texts(table_remarks(table, None))}


def import_logs(request: dict[str, Any], tell: Tell) -> dict[str, Any]:
    """The table's content, remarks, and the names of the written files.

    Raises `InputError` where the map does not suit the log, as `soilml import` does.
    """

    def progress(stage: str, done: int, total: int) -> None:
        tell(stage, done / total if total else None)

    log_map = setting_file("MAP.toml", request.get("map"))
    accept = request.get("accept") is True
    found = import_log(request["names"], log_map, accept=accept, progress=progress)
    tell("drawing the report")
    contents = {
        RUNS_FILE: csv_text(found.table.columns),
        "import_report.html": page(
            found.report(), Provenance.of(["import", *found.sources, "--map", found.map_name], [])
        ),
        "import_report.json": json_text(found.as_json()),
        "bias.toml": found.bias_toml(),
        "map.toml": str(request.get("map")),
    }
    left_out = sum(stop.stop - stop.start for _, stop in found.left_out())
    whole = sum(float(s.time[-1] - s.time[0]) for s in found.series)
    return {
        "kind": "runs",
        **table_summary(found.table),
        "name": RUNS_FILE,
        "remarks": texts((*found.implausible, *found.remarks)),
        "left_out": left_out,
        "seconds": whole,
        "files": write_files(contents),
    }


def is_table_of_runs(file: Path) -> bool:
    """Whether a file has the columns of a table of runs, or two of them, and no clock."""
    if file.suffix == ".parquet":
        from soilml.io.parquet import read_parquet

        header = set(read_parquet(file)[0])
    elif is_spreadsheet(file):
        header = set(next((row for row in sheet_rows(file) if row), []))
    elif file.suffix.lower() in (".csv", ".txt", ".tsv"):
        with file.open("rb") as opened:
            line = opened.readline(1 << 16).decode("utf-8-sig", errors="replace")
        header = {cell.strip().strip("\"'") for cell in re.split(r"[,;\t]", line)}
    else:
        return False
    clock = header & {"time", "t", "time_s"}
    return header >= {*RUNS} or (len(header & _KNOWN) >= 2 and not clock)


def table_summary(table: Table) -> dict[str, Any]:
    """Rows, runs, ranges and readings of a table, for a picture of it."""
    rows = table.rows(table.answered)
    index = np.unique(np.linspace(0, max(len(rows) - 1, 0), min(len(rows), _DRAWN)).astype(int))
    drawn = rows.rows(index)
    measured = [
        key
        for key in ("torque_Nm", "drawbar_pull_N", "sinkage_m")
        if key in rows and np.isfinite(rows[key]).any()
    ]
    runs = list(dict.fromkeys(str(name) for name in rows["run"])) if "run" in rows else []
    return {
        "name": table.source,
        "rows": len(table),
        "used": len(rows),
        "runs": runs,
        "slip": _ends(rows["slip"]),
        "load": _ends(rows["load_N"]),
        "radius": _one_radius(rows),
        "measured": [COLUMNS[key].name.replace("_", " ") for key in measured],
        "points": {key: drawn[key].tolist() for key in ("slip", "load_N", *measured)},
        "point_runs": [str(name) for name in drawn["run"]] if "run" in drawn else [],
    }


def _one_radius(rows: Table) -> float | None:
    """The radius in m at which slip is defined, where the table says it and it is one."""
    radii = np.unique(rows["wheel_radius_m"]) if "wheel_radius_m" in rows else np.zeros(0)
    return float(radii[0]) if radii.size == 1 and np.isfinite(radii[0]) else None


def _ends(values: Any) -> list[float]:
    return [float(np.min(values)), float(np.max(values))] if len(values) else []
