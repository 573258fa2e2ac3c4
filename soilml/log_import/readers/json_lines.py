"""JSON logs: one object for each sample, line by line or in one array; or an object of columns."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from soilml.errors import InputError
from soilml.io.bounds import JSON_BYTES
from soilml.log_import.readers.message_fields import TopicColumns
from soilml.log_import.readers.text_layout import decode_text
from soilml.log_import.recording import Recording
from soilml.remarks import Remark

_FEWEST = 3  # Fewer samples are none, as in text logs


def read_json_log(path: Path) -> list[Recording]:
    """The numbers of a JSON log by dotted name, and its texts.

    Lines that are no object are left out. Raises `InputError` where it has no samples.
    """
    JSON_BYTES.check(path, path.stat().st_size)
    text, _ = decode_text(path.read_bytes(), path)
    samples, bad = _samples(text)
    said = f"{bad} lines are no JSON objects and are left out"
    notes = (Remark("lines-left-out", said),) if bad else ()
    found = TopicColumns(path)
    for number, sample in enumerate(samples):
        found.add(float(number), sample)
    columns = found.columns() if len(samples) >= _FEWEST else {}
    if not columns:
        raise InputError(
            f"{path}: needed is a JSON object with numbers for each sample, one a line or in one "
            "array, or one object of columns"
        )
    samples = [samples[i] for i in found.order()]
    names = dict.fromkeys(k for s in samples for k, v in s.items() if isinstance(v, str))
    texts = {name: [str(s.get(name, "")) for s in samples] for name in names}
    times = found.times()  # numbers of lines, where no header has a stamp
    stamped = not np.array_equal(times, np.arange(len(samples)))
    clock = times if stamped else None
    return [Recording("", path, columns, texts, clock=clock, notes=notes)]


def _parsed(text: str) -> Any:
    """What a text in JSON holds; None for another one."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _samples(text: str) -> tuple[list[dict[str, Any]], int]:
    """The objects of a log, and how many lines are none."""
    whole = _parsed(text)
    if isinstance(whole, dict):
        whole = _rows_of_columns(whole)
    if whole is not None:
        rows = [row for row in whole if isinstance(row, dict)] if isinstance(whole, list) else []
        return rows, 0
    found = [_parsed(line) for line in text.splitlines() if line.strip()]
    rows = [row for row in found if isinstance(row, dict)]
    return rows, len(found) - len(rows)


def _rows_of_columns(columns: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of the lists of an object that have the length of the longest."""
    lists = {name: cells for name, cells in columns.items() if isinstance(cells, list)}
    count = max((len(cells) for cells in lists.values()), default=0)
    lists = {name: cells for name, cells in lists.items() if len(cells) == count}
    return [{name: cells[i] for name, cells in lists.items()} for i in range(count)]
