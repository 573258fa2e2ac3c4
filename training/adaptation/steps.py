"""Steps of a long command that are not repeated while their inputs and outputs are the same."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from soilml import __version__
from soilml.errors import InputError
from soilml.io.atomic_files import save_text
from soilml.report.page import InputRecord, json_text

RECORD = "steps.json"  # File of the folder that says of what its files were made


class ResumableSteps:
    """The steps of a folder, with the checksums of what each read and wrote.

    A step is done where the folder has its files unchanged, made of the same inputs by the same
    version. `kept` has the names of the steps that were found done.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.kept: list[str] = []
        self._known = _read_record(folder / RECORD)

    def run(
        self,
        name: str,
        inputs: Sequence[str | Path],
        outputs: Sequence[str],
        make: Callable[[], object],
    ) -> None:
        """Do a step, unless it is done.

        inputs: Texts, and files whose content counts.
        outputs: Names of the files in the folder that `make` writes, each atomically; it may leave
            some out.

        Raises whatever `make` raises; the step then counts as not done.
        """
        key = _digest(inputs)
        entry = self._known.get(name, {})
        if entry.get("inputs") == key and self._unchanged(entry.get("files")):
            self.kept.append(name)
            return
        for output in outputs:  # what an earlier call left must not be taken for this one's
            (self.folder / output).unlink(missing_ok=True)
        make()
        self._known[name] = {"inputs": key, "files": self._checksums(outputs)}
        save_text(self.folder / RECORD, json_text(self._known))

    def _unchanged(self, files: object) -> bool:
        """Whether the files have the checksums that were written down."""
        if not isinstance(files, dict) or not files:
            return False
        return all(InputRecord.of(self.folder / name).sha256 == sha for name, sha in files.items())

    def _checksums(self, names: Sequence[str]) -> dict[str, str | None]:
        found = {name: InputRecord.of(self.folder / name).sha256 for name in names}
        return {name: sha for name, sha in found.items() if sha is not None}


def _digest(inputs: Sequence[str | Path]) -> str:
    """Checksum of texts and of the content of files, with the version of the package.

    Raises `InputError` for a file that is missing.
    """
    parts = [__version__]
    for one in inputs:
        if isinstance(one, str):
            parts.append(one)
            continue
        sha = InputRecord.of(one).sha256
        if sha is None:
            raise InputError(f"{one}: there is no such file")
        parts.append(sha)
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def _read_record(path: Path) -> dict[str, Any]:
    """The record of a folder; empty where there is none, or it is damaged."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    if not isinstance(content, Mapping):
        return {}
    return {str(k): dict(v) for k, v in content.items() if isinstance(v, Mapping)}
