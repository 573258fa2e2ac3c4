"""Small files beside logs that state constants of the runs: `RUN_PARAMETERS.txt`, `meta.json`."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Sequence
from pathlib import Path

from soilml.errors import InputError, SoilmlError
from soilml.log_import.readers.text_layout import decode_text

_WORDS = "run_?parameters?|test_?parameters?|parameters?|params|meta_?data|meta|settings|config"
_WORDS += "|configuration|test_?info|run_?info|info|header"
_ENDINGS = {".txt", ".json", ".yaml", ".yml", ".toml", ".ini", ".cfg", ".csv", ".md"}
#: Names that say that a file states constants of a whole folder, and of one log of its stem.
_OF_FOLDER = re.compile(rf"(?:{_WORDS})", re.IGNORECASE)
_OF_LOG = re.compile(rf"[ _.-](?:{_WORDS})", re.IGNORECASE)
_LARGEST, _MOST_FILES, _MOST_LINES = 65_536, 2_000, 200
_MARKS = re.compile(r"[{}\"]|,\s*$")  # What JSON writes around names and values


def is_side_file(file: Path) -> bool:
    """Whether a file states constants, by its name, and is no log."""
    return file.suffix.lower() in _ENDINGS and bool(_OF_FOLDER.fullmatch(file.stem))


def log_files(logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> list[Path]:
    """The files, without those that state constants of the others.

    Raises `InputError` where there is none.
    """
    files = [Path(f) for f in ([logs] if isinstance(logs, str | os.PathLike) else logs)]
    if not files:
        raise InputError("no log was given; needed is at least one file")
    return [file for file in files if not is_side_file(file)] or files


def side_lines(log: Path) -> tuple[str, ...]:
    """The lines of the files beside a log that state constants of it, its own ones first.

    They are those in its folder that are called as `RUN_PARAMETERS`, or as the log and so.
    """
    try:
        if log.is_dir():
            return ()
        beside = sorted(log.parent.iterdir())[:_MOST_FILES]
    except OSError:
        return ()
    own = [f for f in beside if _is_of(f, log)]
    lines = [line for f in (*own, *filter(is_side_file, beside)) if f != log for line in _lines(f)]
    return tuple(dict.fromkeys(lines))


def _is_of(file: Path, log: Path) -> bool:
    if file.suffix.lower() not in _ENDINGS or not file.stem.startswith(log.stem):
        return False
    return bool(_OF_LOG.fullmatch(file.stem[len(log.stem) :]))


def _lines(file: Path) -> list[str]:
    """Lines `name: value` of a file; none of one that is large, or no text."""
    try:
        if not file.is_file() or file.stat().st_size > _LARGEST:
            return []
        text, _ = decode_text(file.read_bytes(), file)
    except (OSError, SoilmlError):
        return []
    lines = [line for line in text.splitlines() if line.strip()]
    if file.suffix.lower() == ".csv" and len(lines) == 2:
        try:
            names, values = csv.reader(lines)
        except (csv.Error, ValueError):
            return []
        return [f"{a.strip()}: {b.strip()}" for a, b in zip(names, values, strict=False)]
    return [_MARKS.sub("", line).strip() for line in lines[:_MOST_LINES]]
