"""Files that were dropped on the page, in a folder that goes when the server ends."""

from __future__ import annotations

import re
import secrets
import shutil
from dataclasses import dataclass
from pathlib import Path

from soilml.errors import InputError

LARGEST_FILE, LARGEST_SUM = 256 << 20, 1 << 30  # Largest file, and all files together, bytes
#: Bytes of a name and of its ending; file systems take 255 in all.
_LONGEST_NAME, _LONGEST_ENDING = 120, 16


@dataclass(frozen=True)
class Upload:
    """A file of the page, of this many bytes when all of it has come."""

    key: str
    path: Path
    size: int

    def as_json(self) -> dict[str, object]:
        """What the page knows of it."""
        return {"id": self.key, "name": self.path.name, "bytes": self.size}


class Uploads:
    """The files, by keys that cannot be guessed; each stands in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._files: dict[str, Upload] = {}

    def place(self, name: str, size: int) -> Upload:
        """Where a file of this name and size (bytes) will be written; `InputError` if too large.

        Its size counts from now on, until `drop`: files may come at the same time.
        """
        if size > LARGEST_FILE:
            raise InputError(
                f"{plain_name(name)} has {size / 2**20:.0f} MB; at most {LARGEST_FILE >> 20} MB "
                "are accepted: thin it, or use `soilml import` on the command line"
            )
        if sum(upload.size for upload in self._files.values()) + size > LARGEST_SUM:
            raise InputError(
                f"the files of this page have {LARGEST_SUM >> 20} MB together: restart soilml serve"
            )
        key = secrets.token_hex(16)
        (self.folder / key).mkdir(parents=True)
        self._files[key] = Upload(key, self.folder / key / plain_name(name), size)
        return self._files[key]

    def drop(self, upload: Upload) -> None:
        """Remove a file of which not all has come."""
        self._files.pop(upload.key, None)
        shutil.rmtree(self.folder / upload.key, ignore_errors=True)

    def find(self, key: object) -> Upload:
        """The file of a key; `InputError` where there is none."""
        if not isinstance(key, str) or key not in self._files:
            raise InputError("the file is gone: the server was restarted; drop it again")
        return self._files[key]


def plain_name(name: str) -> str:
    """A file name without folders and without characters that mean something to a shell or system.

    >>> plain_name("../../etc/pass wd.csv"), plain_name("..")
    ('pass wd.csv', 'file')
    """
    base = re.split(r"[/\\]", name)[-1]
    kept = re.sub(r"[^\w .()+-]", "_", base).strip(" .").lstrip("-")
    stem, dot, ending = kept.rpartition(".")
    named = f"{_first_bytes(stem, _LONGEST_NAME)}{dot}{_first_bytes(ending, _LONGEST_ENDING)}"
    return named.strip() or "file"


def _first_bytes(text: str, most: int) -> str:
    """The longest beginning of a text that has no more bytes in UTF-8."""
    return text.encode()[:most].decode(errors="ignore")
