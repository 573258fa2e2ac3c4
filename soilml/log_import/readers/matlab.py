"""MATLAB files: variables and nested structs; timeseries of Simulink; HDF5, as version 7.3 is.

How much the arrays of a file hold is counted before a library reads them: a packed element may
stand for a thousand times its size, and a cell array may claim any number of cells.
"""

from __future__ import annotations

import math
import mmap
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.io.bounds import DEPTH, LOG_VALUES, PARTS
from soilml.log_import.recording import Recording
from soilml.optional_imports import need

_DEEPEST = 6
_SHORTEST = 8  # Shorter arrays are constants, not samples
_HEAD = 128  # Bytes before the first element; the last four are version and byte order
_MATRIX, _COMPRESSED = 14, 15
_OPAQUE = 17  # Class of arrays whose header has no dimensions
#: Bytes of a value by the type of its element ("MAT-File Format", The MathWorks, table 1-1).
_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
_MOST_BYTES = 8 * LOG_VALUES.most + (1 << 20)  # Of a packed array that has no more values


def read_matlab(path: Path) -> list[Recording]:
    """The arrays of a MATLAB file, those of one struct and one length as one recording.

    A matrix of few columns becomes `name_1`, `name_2`, ... A struct array becomes one recording
    for each element. Single numbers and texts become lines of `about`.

    Raises `InputError` where the file is damaged or has no arrays.
    """
    with path.open("rb") as opened:
        head = opened.read(128)
    of_hdf5 = b"MATLAB 7.3" in head or head.startswith(b"\x89HDF")
    groups: dict[tuple[str, int], dict[str, Floats]] = {}
    about: list[str] = []
    for place, array in _hdf5_values(path) if of_hdf5 else _version_5_values(path):
        if not _is_samples(array):
            if np.ndim(array) == 0:
                about.append(f"{place} = {array}")
            continue
        parent, _, name = place.rpartition(".")
        if name.lower() in ("data", "values", "signals") and parent:
            # timeseries: X.Time and X.Data; the name of the signal says more than "Data"
            name = parent.rpartition(".")[2]
        for column, values in _split(name, array):
            group = groups.setdefault((parent, len(values)), {})
            group[column if column not in group else f"{column}#2"] = values
    if not groups:
        raise InputError(f"{path} has no numeric arrays of {_SHORTEST} samples or more")
    if len({parent for parent, _ in groups}) == len(groups):
        named = {parent: columns for (parent, _), columns in groups.items()}
    else:
        named = {f"{parent}[{length}]": columns for (parent, length), columns in groups.items()}
    if len(named) == 1:
        named = {"": next(iter(named.values()))}
    return [Recording(name, path, columns, about=tuple(about)) for name, columns in named.items()]


def _split(name: str, array: Any) -> Iterator[tuple[str, Floats]]:
    values = np.asarray(array, dtype=np.float64)
    if values.ndim == 1:
        yield name, values
        return
    rows = values if values.shape[0] >= values.shape[1] else values.T
    for i in range(rows.shape[1]):
        yield f"{name}_{i + 1}", np.ascontiguousarray(rows[:, i])


def _is_samples(array: Any) -> bool:
    array = np.asarray(array)
    return (
        array.dtype.kind in "iufb"
        and array.ndim in (1, 2)
        and array.size >= _SHORTEST
        and (array.ndim == 1 or min(array.shape) <= 32)
    )


def _version_5_values(path: Path) -> Iterator[tuple[str, Any]]:
    need("scipy", "import")
    from scipy.io import loadmat

    check_matlab_size(path)
    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except Exception as error:  # scipy raises many kinds for damaged files
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path} is not a complete MATLAB file: {first}") from None
    for name, value in content.items():
        if not name.startswith("__"):
            yield from _values_in(name, value)


def _values_in(place: str, value: Any, depth: int = 0) -> Iterator[tuple[str, Any]]:
    """The texts, numbers and arrays in structs and cells, with their places."""
    if depth > _DEEPEST:
        return
    if hasattr(value, "_fieldnames"):
        for name in value._fieldnames:
            yield from _values_in(f"{place}.{name}", getattr(value, name), depth + 1)
    elif isinstance(value, np.ndarray) and value.dtype == object:
        for i, element in enumerate(value.reshape(-1), 1):
            yield from _values_in(f"{place}_{i}", element, depth + 1)
    else:
        yield place, value


def _hdf5_values(path: Path) -> list[tuple[str, Any]]:
    try:
        import h5py
    except ImportError:
        raise InputError(
            f"{path} is an HDF5 file, as MATLAB 7.3 writes them, which needs h5py: pip install "
            "'.[logs]'; or save it in MATLAB with save(..., '-v7')"
        ) from None
    found: list[tuple[str, Any]] = []
    parts = total = 0

    def visit(name: str, item: Any) -> None:
        nonlocal parts, total
        parts += 1
        PARTS.check(path, parts)
        if name.startswith("#") or not isinstance(item, h5py.Dataset):
            return
        if item.external or item.is_virtual:  # which lie in other files
            raise InputError(f"{path}: {name} is in another file; needed are all data in one")
        total += item.size or 0
        LOG_VALUES.check(path, max(total, math.prod(item.chunks or ())))
        if item.dtype.kind in "iufb" and item.attrs.get("MATLAB_class", b"") != b"char":
            found.append((name.replace("/", "."), np.squeeze(np.asarray(item))))

    try:
        with h5py.File(path, "r") as opened:
            opened.visititems(visit)
    except InputError:
        raise
    except Exception as error:  # h5py raises many kinds for damaged files
        first = " ".join(str(error).split())
        raise InputError(f"{path} is not a complete HDF5 file: {first}") from None
    return found


def check_matlab_size(file: Path) -> None:
    """Raise `InputError` for more values, arrays or structs in one another than may be read.

    file: A file of version 5; of version 4, whose arrays are neither packed nor nested, nothing is
        said, nor of what is damaged.
    """
    if file.stat().st_size <= _HEAD:
        return
    values = parts = 0

    def count(data: mmap.mmap | bytes, at: int, end: int, depth: int = 0) -> None:
        """Count the values and arrays between two places, element by element."""
        nonlocal values, parts
        DEPTH.check(file, depth)
        while at + 8 <= end:
            kind, start, size, after = _tag(order, data, at)
            if kind == _COMPRESSED and isinstance(data, mmap.mmap):
                with suppress(zlib.error):  # of a damaged file, as the library will say
                    unpacked = zlib.decompressobj().decompress(data[start:after], _MOST_BYTES)
                    LOG_VALUES.check(file, len(unpacked) // 8)
                    count(unpacked, 0, len(unpacked))
            elif kind == _MATRIX:
                parts += 1
                PARTS.check(file, parts)
                inner, claimed = _shape(order, data, start, min(after, end))
                LOG_VALUES.check(file, claimed)  # which is allocated before it is read
                count(data, inner, min(after, end), depth + 1)
            elif depth:
                values += size // _BYTES.get(kind, 1)
                LOG_VALUES.check(file, values)
            at = after

    with file.open("rb") as opened, mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if order := {b"IM": "<", b"MI": ">"}.get(data[_HEAD - 2 : _HEAD], ""):
            count(data, _HEAD, len(data))


def _tag(order: str, data: mmap.mmap | bytes, at: int) -> tuple[int, int, int, int]:
    """Type of an element, where its content begins, its bytes, and where the next begins."""
    kind, size = struct.unpack_from(f"{order}II", data, at)
    if kind >> 16:  # a small element, whose content is in its tag
        return kind & 0xFFFF, at + 4, kind >> 16, at + 8
    return kind, at + 8, size, at + 8 + size + (0 if kind == _COMPRESSED else -size % 8)


def _shape(order: str, data: mmap.mmap | bytes, at: int, end: int) -> tuple[int, int]:
    """Where the name of an array begins, and how many values it claims."""
    if at + 24 > end:  # an empty one has no flags
        return end, 0
    _, flags, _, at = _tag(order, data, at)
    if struct.unpack_from(f"{order}I", data, flags)[0] & 0xFF == _OPAQUE:
        return at, 0
    _, start, size, after = _tag(order, data, at)
    shape = data[start : min(start + size // 4 * 4, end)]
    sizes = struct.unpack(f"{order}{len(shape) // 4}i", shape[: len(shape) // 4 * 4])
    return after, math.prod(max(n, 0) for n in sizes)
