"""Raw logs and a map become a table of runs."""

from __future__ import annotations

from typing import Any

from soilml.cli.output import json_text
from soilml.io.text_tables import csv_text
from soilml.log_import.page import page
from soilml.log_import.workflow import import_log
from soilml.serve.answers.dropped_file import table_summary
from soilml.serve.answers.job_output import Tell, setting_file, write_files

#: The table that an import writes.
RUNS_FILE = "runs.csv"


def answer(request: dict[str, Any], tell: Tell) -> dict[str, Any]:
    """The table's content, remarks, and the names of the written files.

    Raises `InputError` where the map does not suit the log, as `soilml import` does.
    """

    def progress(stage: str, done: int, total: int) -> None:
        tell(stage, done / total if total else None)

    log_map = setting_file("MAP.toml", request.get("map"))
    accept = request.get("accept") is True
    found = import_log(request["names"], log_map, accept=accept, progress=progress)
    tell("drawing the report")
    texts = {
        RUNS_FILE: csv_text(found.table.columns),
        "import_report.html": page(found, progress),
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
        "remarks": [*found.implausible, *found.remarks],
        "left_out": left_out,
        "seconds": whole,
        "files": write_files(texts),
    }
