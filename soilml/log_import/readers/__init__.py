"""Readers of logs, by the ending of the file's name; a new format is one line in `_READERS`.

They import their libraries when they are called.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.io.atomic_files import refuse_device
from soilml.io.spreadsheet import ENDINGS, split_sheet
from soilml.log_import.readers.side_files import side_lines
from soilml.log_import.recording import Recording
from soilml.remarks import Remark

Progress = Callable[[str, int, int], None]  # Of a stage: items done, and their number
#: Ending -> module and function; any other ending is read as text.
_READERS = {
    ".parquet": ("parquet_log", "read_parquet_log"),
    **dict.fromkeys(ENDINGS, ("delimited_text", "read_spreadsheet_log")),
    ".mat": ("matlab", "read_matlab"),
    ".h5": ("matlab", "read_matlab"),
    ".hdf5": ("matlab", "read_matlab"),
    ".json": ("json_lines", "read_json_log"),
    ".jsonl": ("json_lines", "read_json_log"),
    ".ndjson": ("json_lines", "read_json_log"),
    ".mcap": ("bags", "read_bag"),
    ".bag": ("bags", "read_bag"),
}
_LONG = ("read_delimited_text", "read_bag")  # Readers that show their progress
#: What to do with files of other kinds, by their ending.
_OTHERS = {
    **dict.fromkeys((".xls", ".xlsb", ".ods"), "is a spreadsheet; save it as .xlsx"),
    **dict.fromkeys((".gz", ".zip", ".bz2", ".xz", ".7z", ".tar"), "is packed; unpack it"),
    ".db3": "is part of a ROS 2 bag; give its folder",
    ".tdms": "is a binary file of LabVIEW; save it as text (.lvm or CSV)",
}
#: Ends of the ranges of integers, which converters without a signal show.
_ENDS = (32767.0, -32768.0, 65535.0, 2147483647.0, -2147483648.0, 4294967295.0)
_HUGE = 1e30  # From this size on no reading of a rig is meant; squares of smaller ones are finite
#: How often a code must stand in a column, and how many ranges of all other readings away.
_LEAST, _RANGES = 2, 3.0


def read_log(path: str | Path, progress: Callable[[int], None] | None = None) -> list[Recording]:
    """The recordings of a log, with what files beside it state.

    path: A file, the folder of a bag, or a sheet of a spreadsheet as `BOOK.xlsx#SHEET`.
    progress: Called with the number of bytes read, of text logs and bags.

    Raises `InputError` where it is missing or cannot be read.
    """
    file, sheet = split_sheet(path)
    if not file.exists():
        raise InputError(f"{file}: there is no such file")
    suffix = file.suffix.lower()
    if suffix in _OTHERS and file.is_file():
        raise InputError(f"{file} {_OTHERS[suffix]} and import that")
    if file.is_dir():
        if not (file / "metadata.yaml").is_file():
            raise InputError(
                f"{file} is a folder; needed are log files, or the folder of a ROS 2 bag, which "
                "has a metadata.yaml"
            )
        suffix = ".bag"
    module, function = _READERS.get(suffix, ("delimited_text", "read_delimited_text"))
    found = import_module(f"soilml.log_import.readers.{module}")
    read: Callable[..., list[Recording]] = getattr(found, function)
    told = (progress,) if function in _LONG else ()
    try:
        refuse_device(file)
        beside = side_lines(file)
        found_in = map(_without_codes, read(Path(path) if sheet else file, *told))
        return [replace(own, about=(*own.about, *beside)) for own in found_in]
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror or error}") from None


def read_logs(files: Sequence[Path], progress: Progress) -> list[list[Recording]]:
    """The recordings of each log; the progress counts bytes."""
    sizes = [file.stat().st_size if file.is_file() else 0 for file in files]
    total, before, recordings = sum(sizes), 0, []
    for file, size in zip(files, sizes, strict=True):
        progress("reading logs", before, total)

        def told(done: int, before: int = before) -> None:
            progress("reading logs", before + done, total)

        recordings.append(read_log(file, told))
        before += size
    progress("reading logs", total, total)
    return recordings


def silent(stage: str, done: int, total: int) -> None:
    """Progress that is not shown."""


def _without_codes(recording: Recording) -> Recording:
    """The recording with NaN where a column has the code of a missing reading or a huge number, and
    where its clock has a huge one; a note says it.
    """
    notes = list(recording.notes)

    def known(name: str, values: Floats, with_code: bool = True) -> Floats:
        if (huge := np.abs(values) >= _HUGE).any():
            text = f"{name}: {int(huge.sum())} numbers of {_HUGE:g} or more are no readings"
            notes.append(Remark("huge-numbers", text, (name,)))
            values = np.where(huge, np.nan, values)
        if with_code and (code := _code_of(values)) is not None:
            found = values == code
            text = f"{name}: {code:g} is no reading, and left out {int(found.sum())} times"
            notes.append(Remark("missing-code", text, (name,)))
            values = np.where(found, np.nan, values)
        return values

    clock = recording.clock
    if clock is not None:
        clock = known("the clock", clock, with_code=False)
    columns = {name: known(name, values) for name, values in recording.columns.items()}
    return replace(recording, columns=columns, clock=clock, notes=tuple(notes))


def _code_of(values: Floats) -> float | None:
    """The code of a missing reading in a column; None where it has none."""
    known = values[np.isfinite(values)]
    for end in (float(known.min()), float(known.max())) if known.size >= _LEAST else ():
        rest = known[known != end]
        digits = f"{abs(end):.10g}".replace(".", "")
        is_code = (len(digits) >= 3 and {*digits} == {"9"}) or end in _ENDS
        if is_code and rest.size and known.size - rest.size >= _LEAST:
            low, high = float(rest.min()), float(rest.max())
            if max(low - end, end - high) > _RANGES * (high - low):
                return end
    return None
