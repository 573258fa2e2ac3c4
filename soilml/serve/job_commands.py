"""What a job of the page runs: a command line on the files of its folder.

The page shows what the command writes, so that both say the same.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from soilml.errors import InputError

#: Folders of a job: of the files that it reads, in which it works, and of what it writes. No
#: written file can replace a read one, and a dropped file may have any name.
READ, WRITTEN = "read", "found"
#: Names of the texts of the page, by which messages call them.
MODEL_FILE, MAP_FILE = "MODEL.toml", "map.toml"
OUT = f"../{WRITTEN}"
LOOKED = f"{OUT}/look.json"  # What `look` finds
COMMAND = "$ "  # Begins the line in which a worker says what it runs
#: Columns by two of which a table of runs is known, where no column is a clock.
_RUNS, _CLOCKS = {"slip", "load_N", "torque_Nm", "drawbar_pull_N", "sinkage_m"}, {"time", "t"}


def command_of(request: Mapping[str, Any]) -> list[str]:
    """The words of the command of a request; writes the texts of the page beside the files.

    There are none for a look at files. Raises `InputError` for a text that names other files than
    those of the page.
    """
    return KINDS[request["kind"]](request)


def _look(request: Mapping[str, Any]) -> list[str]:
    """Write what the dropped files are."""
    Path(LOOKED).write_text(json.dumps(_kind(request)), encoding="utf-8")
    return []


def _kind(request: Mapping[str, Any]) -> dict[str, Any]:
    """The kind of the dropped files: a table of runs, logs, or a spreadsheet of several sheets."""
    from soilml.io.read_table import RUNS, read_table
    from soilml.io.spreadsheet import is_spreadsheet, sheet_rows, sheets_with_cells, split_sheet

    name = request["names"][0]
    file, sheet = split_sheet(name)
    if is_spreadsheet(file):
        sheets = sheets_with_cells(file)
        if len(sheets) > 1 and not sheet:
            return {"kind": "sheets", "sheets": sheets}
        header = set(next((row for row in sheet_rows(Path(name)) if row), []))
    else:
        header = _header(Path(name))
    if len(request["names"]) > 1 or len(header & _RUNS) < 2 or header & _CLOCKS:
        return {"kind": "log"}
    table = read_table(name, RUNS)
    radii = {*table["wheel_radius_m"].tolist()} if "wheel_radius_m" in table else set()
    return {
        "kind": "runs",
        "rows": len(table),
        "runs": list(dict.fromkeys(map(str, table["run"]))),
        "radius": radii.pop() if len(radii) == 1 else None,
        "measured": [c for c in ("drawbar_pull_N", "sinkage_m") if c in table],
    }


def _header(file: Path) -> set[str]:
    """The names of the columns of a table; empty for other files."""
    if file.suffix == ".parquet":
        from soilml.io.parquet import read_parquet

        return set(read_parquet(file)[0])
    if file.suffix.lower() not in (".csv", ".txt", ".tsv"):
        return set()
    with file.open("rb") as opened:
        line = opened.readline(1 << 16).decode("utf-8-sig", errors="replace")
    return {cell.strip().strip("\"'") for cell in re.split(r"[,;\t]", line)}


def _model_and_rows(request: Mapping[str, Any]) -> list[str]:
    from soilml.config.case import read_case

    model = _text_file(MODEL_FILE, request.get("model"))
    read_case(model, with_bias=True, names_files=False, with_explanations=True)
    run = request.get("run")
    return [MODEL_FILE, request["names"][0], *([f"--where=run={run}"] if run else [])]


def _import(request: Mapping[str, Any]) -> list[str]:
    _text_file(MAP_FILE, request.get("map"))
    accept = ["--accept"] if request.get("accept") is True else []
    out = f"{OUT}/runs.csv"
    return ["import", *request["names"], "--map", MAP_FILE, "--out", out, *accept]


def _init(request: Mapping[str, Any]) -> list[str]:
    """A first model file for a wheel of these sizes, m; without a soil its bearing is unknown."""
    words = ["init", f"{OUT}/{MODEL_FILE}"]
    for name in ("radius", "width", "soil"):
        if (value := request.get(name)) not in (None, ""):
            words.append(f"--{name}={value}")
    return words


def _text_file(name: str, text: object) -> Path:
    """A text box of the page as a file of this name, so that errors name it."""
    if not isinstance(text, str) or not text.strip():
        raise InputError(f"{name} is missing")
    path = Path(name)
    if path.exists():
        raise InputError(f"a dropped file has the name {name}; rename it")
    path.write_text(text, encoding="utf-8")
    return path


#: Words of the command by the kind of a job.
KINDS: Mapping[str, Callable[[Mapping[str, Any]], list[str]]] = {
    "look": _look,
    "identify": lambda r: ["identify", *_model_and_rows(r), "--report", OUT],
    "gap": lambda r: ["gap", *_model_and_rows(r), "--out", OUT],
    "pull": lambda r: ["pull", *_model_and_rows(r), "--report", OUT],
    "draft": lambda r: ["import", "--init", *r["names"], "--out", f"{OUT}/{MAP_FILE}"],
    "import": _import,
    "init": _init,
    "example": lambda _: ["example", OUT],
}
#: Kinds of jobs that read no dropped file.
WITHOUT_FILES = ("init", "example")
