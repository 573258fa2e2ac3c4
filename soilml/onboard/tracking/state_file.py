"""The state of a tracker as a file that a loss of power leaves whole, old or new."""

from __future__ import annotations

import io
import os
import stat
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from soilml.errors import InputError
from soilml.onboard.tracking.filter_state import Arrays

#: Largest file, and largest content, bytes. Those that are written have some 100 kB.
MOST_BYTES = 8 << 20


def write_state(path: str | os.PathLike[str], arrays: Mapping[str, Any]) -> None:
    """Write what `SoilTracker.save` gives; the file is that before, or this one, at any time.

    The file beside it with the ending `.part` is replaced, and its content is on the disk before
    it takes the name. Raises OSError where it cannot be written.
    """
    file = Path(path)
    part = file.with_name(file.name + ".part")
    with part.open("wb") as opened:
        np.savez(opened, **arrays)
        opened.flush()
        os.fsync(opened.fileno())
    part.replace(file)
    if hasattr(os, "O_DIRECTORY"):  # the name too
        folder = os.open(file.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def read_state(path: str | os.PathLike[str]) -> Arrays:
    """The arrays that `write_state` wrote, for `SoilTracker.restore`.

    Raises `InputError` for a file that cannot be read, is none of these, or is larger than
    `MOST_BYTES`, which is known before its content is read.
    """
    try:
        with Path(path).open("rb") as opened:
            found = os.fstat(opened.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise InputError(f"{path} is a device or a pipe; needed is a state of a tracker")
            _check_size(path, found.st_size)
            with zipfile.ZipFile(opened) as archive:
                _check_size(path, sum(entry.file_size for entry in archive.infolist()))
                return {
                    name.removesuffix(".npy"): np.lib.format.read_array(
                        io.BytesIO(archive.read(name)), allow_pickle=False
                    )
                    for name in archive.namelist()
                }
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file raises
        first = " ".join(str(error).split())
        raise InputError(f"{path} is damaged, or no state of a tracker: {first}") from None


def _check_size(path: str | os.PathLike[str], size: int) -> None:
    if size > MOST_BYTES:
        raise InputError(
            f"{path} holds {size / 2**20:.0f} MB; a state of a tracker has at most "
            f"{MOST_BYTES >> 20} MB"
        )
