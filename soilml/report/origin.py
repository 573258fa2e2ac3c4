"""What a report was made from: the command, the version, and the files with their checksums."""

from __future__ import annotations

import hashlib
import os
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

#: Version of the entry `report` in the JSON files: raised where a key changes its meaning or goes.
FORMAT_VERSION = 1
_BLOCK = 1 << 20


@dataclass(frozen=True)
class InputRecord:
    """A file that was read: its name as given, its size in bytes and its SHA-256 checksum.

    Size and checksum are None for what is no regular file, such as a pipe or a folder.
    """

    name: str
    size: int | None = None
    sha256: str | None = None

    @staticmethod
    def of(path: str | os.PathLike[str]) -> InputRecord:
        """The record of a file as it is now."""
        file = Path(path)
        try:
            if not file.is_file():
                return InputRecord(os.fspath(path))
            total, found = 0, hashlib.sha256()
            with file.open("rb") as opened:
                while block := opened.read(_BLOCK):
                    total += len(block)
                    found.update(block)
        except OSError:
            return InputRecord(os.fspath(path))
        return InputRecord(os.fspath(path), total, found.hexdigest())


@dataclass(frozen=True)
class Origin:
    """Command line, version of soilml, and input files."""

    command: str
    version: str
    files: tuple[InputRecord, ...] = ()

    @staticmethod
    def of(words: Sequence[str], files: Iterable[str | os.PathLike[str]]) -> Origin:
        """The origin of a report that the words after `soilml` asked for."""
        from soilml import __version__

        names = [name for name in dict.fromkeys(os.fspath(f) for f in files) if Path(name).exists()]
        records = tuple(InputRecord.of(name) for name in names)
        return Origin(shlex.join(["soilml", *words]), __version__, records)


def report_entry(
    kind: str,
    origin: Origin,
    answer: Sequence[str],
    warnings: Sequence[str],
    next_steps: Sequence[str],
) -> dict[str, Any]:
    """The entry `report` of the JSON file that stands beside a page.

    Parameters
    ----------
    kind
        The command, such as `identify`.
    answer, warnings, next_steps
        The texts of the page: what was found, what limits it, what to do next.
    """
    return {
        "format": "soilml-report",
        "version": FORMAT_VERSION,
        "kind": kind,
        "command": origin.command,
        "soilml_version": origin.version,
        "files": [{"name": f.name, "bytes": f.size, "sha256": f.sha256} for f in origin.files],
        "answer": _plain(answer),
        "warnings": _plain(warnings),
        "next": _plain(next_steps),
    }


def _plain(texts: Sequence[str]) -> list[str]:
    return [text.replace("\N{NO-BREAK SPACE}", " ") for text in texts]
