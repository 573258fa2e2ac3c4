"""Files that were dropped on the page, in a folder that goes when the server ends."""

from __future__ import annotations

import re
import secrets
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from soilml.errors import InputError

LARGEST_FILE, LARGEST_SUM = 256 << 20, 1 << 30  # Largest file, and all files together, bytes
#: Seconds without a byte after which an upload has stalled, and makes room for another one.
STALLED_AFTER = 15.0
#: Bytes of a name and of its ending; file systems take 255 in all.
_LONGEST_NAME, _LONGEST_ENDING = 120, 16


@dataclass(frozen=True)
class Upload:
    """A file of the page."""

    key: str
    path: Path

    def as_json(self) -> dict[str, object]:
        """What the page knows of it."""
        return {"id": self.key, "name": self.path.name, "bytes": self.path.stat().st_size}


class Uploads:
    """The files, by keys that cannot be guessed; each stands in a folder of its own."""

    def __init__(self, folder: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self.folder = folder
        self._clock = clock
        self._files: dict[str, Upload] = {}
        #: size of each file that is coming, and when its last piece came
        self._coming: dict[str, tuple[Upload, int, float]] = {}

    def place(self, name: str, size: int) -> Upload:
        """Where a file of this name and size (bytes) will be written; `InputError` if too large.

        Its size counts from now on, until `add` or `drop`: files may come at the same time. Where
        there is no room, uploads that have stalled are dropped.
        """
        if size > LARGEST_FILE:
            raise InputError(
                f"{plain_name(name)} has {size / 2**20:.0f} MB; at most {LARGEST_FILE >> 20} MB "
                "are taken here: thin it, or use `soilml import` on the command line"
            )
        held = sum(f.path.stat().st_size for f in self._files.values() if f.path.exists())
        room = LARGEST_SUM - held - size
        if self._bytes_to_come() > room:
            for upload, _, last in list(self._coming.values()):
                if self._clock() - last > STALLED_AFTER:
                    self.drop(upload)
        if self._bytes_to_come() > room:
            raise InputError(
                f"the files of this page have {LARGEST_SUM >> 20} MB together: restart soilml serve"
            )
        key = secrets.token_hex(16)
        (self.folder / key).mkdir(parents=True)
        upload = Upload(key, self.folder / key / plain_name(name))
        self._coming[key] = upload, size, self._clock()
        return upload

    def has_come_on(self, upload: Upload) -> bool:
        """Note that a piece of a file has come; false where the file was dropped meanwhile."""
        if upload.key not in self._coming:
            return False
        self._coming[upload.key] = (*self._coming[upload.key][:2], self._clock())
        return True

    def _bytes_to_come(self) -> int:
        return sum(size for _, size, _ in self._coming.values())

    def add(self, upload: Upload) -> Upload:
        """Make a file known that has been written to its place."""
        self._coming.pop(upload.key)
        self._files[upload.key] = upload
        return upload

    def drop(self, upload: Upload) -> None:
        """Remove a file of which not all has come."""
        self._coming.pop(upload.key, None)
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
