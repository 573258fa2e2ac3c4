"""The state of a tracker as bytes, and as a file that a loss of power leaves whole, old or new."""

from __future__ import annotations

import base64
import json
import os
import stat
import zlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from soilml.errors import InputError
from soilml.onboard.memory import Memory
from soilml.onboard.set_contract import Floats
from soilml.onboard.tracking.filter_state import FilterState, RepeatedReadings, RowsInQuestion
from soilml.onboard.tracking.misfit import Rows
from soilml.onboard.tracking.row_window import RowWindow, join

FORMAT = 7  # Version of the bytes
MOST_BYTES = 8 << 20  # Largest file. Those that are written have some 100 kB


def packed_state(state: FilterState, identity: str) -> bytes:
    """Everything as JSON behind its checksum, for the file of this identity."""
    content = {"format": FORMAT, "model": identity, "state": _plain(state)}
    text = json.dumps(content).encode()
    return b"%08x" % zlib.crc32(text) + text


def unpacked_state(content: bytes, identity: str, start: Memory) -> FilterState:
    """The state that `packed_state` wrote for the file of this identity.

    start: A memory of the file without rows.

    Raises `InputError` for bytes of another file or version, or damaged ones.
    """
    begin = "begin with SoilTracker(estimator)"
    try:
        if int(content[:8], 16) != zlib.crc32(content[8:]):
            raise ValueError("its checksum does not match")
        found = json.loads(content[8:])
        if found["format"] != FORMAT:
            raise InputError(
                f"this state of a tracker has format {found['format']}; this version of soilml "
                f"reads format {FORMAT}: {begin}"
            )
        if found["model"] != identity:
            raise InputError(
                f"this state of a tracker is of {found['model']!r}, which is another file, wheel, "
                f"prior or error of sensors than {identity!r}: {begin}"
            )
        return _state(found["state"], start)
    except InputError:
        raise
    except Exception as error:  # whatever damaged bytes raise
        raise InputError(f"this state of a tracker is damaged ({error}): {begin}") from None


def _plain(value: Any) -> Any:
    """A value of JSON: dataclasses as objects, arrays as their float64 bytes with their shape."""
    if is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, np.ndarray):
        data = base64.b64encode(value.astype("<f8").tobytes()).decode()
        return {"shape": value.shape, "data": data}
    if isinstance(value, dict):
        return {name: _plain(own) for name, own in value.items()}
    if isinstance(value, tuple):
        return [_plain(own) for own in value]
    return value


def _array(entry: Mapping[str, Any]) -> Floats:
    return np.frombuffer(base64.b64decode(entry["data"]), "<f8").reshape(entry["shape"]).copy()


def _rows(entry: Mapping[str, Any]) -> Rows:
    return {name: _array(values) for name, values in entry.items()}


def _memory(entry: Mapping[str, Any], start: Memory) -> Memory:
    system, counts = _array(entry["system"]), _array(entry["counts"])
    if system.shape[1:] != start.system.shape[1:] or counts.shape != start.counts.shape:
        raise ValueError(f"its system has shape {system.shape}")
    if not all((np.abs(part) < np.finfo(np.float32).max).all() for part in (system, counts)):
        raise ValueError("it has numbers that are not finite, or too large")
    return replace(start, system=system, counts=counts.astype(np.float32))


def _state(entry: Mapping[str, Any], start: Memory) -> FilterState:
    """The inverse of `_plain`."""
    own, asked, repeated = entry["window"], entry["question"], entry["repeated"]
    blocks = tuple(_memory(block, start) for block in own["blocks"])
    memory = join(blocks) if blocks else start
    previous = repeated["previous"]
    return FilterState(
        RowWindow(blocks, memory, own["length"], tuple(own["added"])),
        RowsInQuestion(
            tuple(map(_rows, asked["rows"])), tuple(asked["disagree"]), asked["in_succession"]
        ),
        RepeatedReadings(
            None if previous is None else _rows(previous),
            tuple(repeated["times"]),
            tuple(repeated["changes"]),
        ),
        tuple(entry["increases"]),
        entry["rows_since_change"],
        entry["rows_since_drift"],
        entry["variance"],
    )


def write_state(path: str | os.PathLike[str], content: bytes) -> None:
    """Write what `SoilTracker.save` gives; the file is that before, or this one, at any time.

    The file beside it with the ending `.part` is replaced, and its content is on the disk before
    it takes the name. Raises OSError where it cannot be written.
    """
    file = Path(path)
    part = file.with_name(file.name + ".part")
    with part.open("wb") as opened:
        opened.write(content)
        opened.flush()
        os.fsync(opened.fileno())
    part.replace(file)
    if hasattr(os, "O_DIRECTORY"):  # the name too
        folder = os.open(file.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def read_state(path: str | os.PathLike[str]) -> bytes:
    """What `write_state` wrote, for `SoilTracker.restore`.

    Raises `InputError` for a file that cannot be read, is no file, or is larger than `MOST_BYTES`,
    which is known before its content is read.
    """
    try:
        with Path(path).open("rb") as opened:
            found = os.fstat(opened.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise InputError(f"{path} is a device or a pipe; needed is a state of a tracker")
            if found.st_size > MOST_BYTES:
                raise InputError(
                    f"{path} holds {found.st_size / 2**20:.0f} MB; a state of a tracker has at "
                    f"most {MOST_BYTES >> 20} MB"
                )
            return opened.read()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
