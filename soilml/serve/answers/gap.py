"""The gap between model and measurements: its report and the files of it."""

from __future__ import annotations

from typing import Any

from soilml.gap import gap
from soilml.gap.report.report import gap_files
from soilml.report.page import page_content
from soilml.serve.answers.estimate import read_rows
from soilml.serve.answers.job_files import MODEL_FILE, Tell, page_case, write_files


def answer(request: dict[str, Any], tell: Tell) -> dict[str, Any]:
    """What the report says and shows, and the names of the written files.

    Raises `SoilmlError` as `soilml gap` does.
    """
    case = page_case(request)
    table = read_rows(request)
    stage = f"analysing {len(table)} rows"
    tell(stage, 0.0)
    found = gap(case, table, progress=lambda share: tell(stage, min(share, 1.0)))
    tell("drawing the report")
    files = write_files(gap_files(found, MODEL_FILE, table.source))
    return {
        "status": found.status,
        "report": page_content(found.report()),
        "rows": len(table),
        "files": files,
    }
