"""Files that are whole or not there."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from soilml.errors import InputError


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A path to write to, which becomes `path` when the block ends well and vanishes when not.

    The part written lies beside the target as `.NAME.part`; one left behind by a killed process is
    overwritten by the next. Raises `InputError` where the folder is missing or the disk is full.
    """
    target = Path(path)
    if target.is_dir():
        raise InputError(f"{target} is a folder; needed is a file name to write to")
    if not target.parent.is_dir():
        raise InputError(f"{target}: there is no folder {target.parent}; create it first")
    part = target.parent / f".{target.name}.part"
    try:
        yield part
        with part.open("rb+") as written:
            os.fsync(written.fileno())
        part.replace(target)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise InputError(f"{target} cannot be written: {error.strerror or error}") from error
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def save_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a whole text file, or none."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")
