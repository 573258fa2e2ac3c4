"""MATLAB files: variables and nested structs; timeseries of Simulink; HDF5, as version 7.3 is."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.io.bounds import LOG_VALUES, PARTS
from soilml.io.cell_text import read_number
from soilml.log_import.readers.matlab_size import check_matlab_size
from soilml.log_import.recording import Recording
from soilml.optional_imports import need

_DEEPEST = 6
_SHORTEST = 8  # Shorter arrays are constants, not samples


def read_matlab(path: Path) -> list[Recording]:
    """The arrays of a MATLAB file, those of one struct and one length as one recording.

    A matrix of few columns becomes `name_1`, `name_2`, ... A struct array becomes one recording
    for each element. Single numbers and texts become lines of `about`.

    Raises `InputError` where the file is damaged or has no arrays.
    """
    with path.open("rb") as opened:
        head = opened.read(128)
    if b"MATLAB 7.3" in head or head.startswith(b"\x89HDF"):
        leaves, about = _hdf5_leaves(path)
    else:
        leaves, about = _version_5_leaves(path)
    groups: dict[tuple[str, int], dict[str, Floats]] = {}
    for place, array in leaves:
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
    _add_settings_of_tests(named, about)
    return [Recording(name, path, columns, about=about) for name, columns in named.items()]


def _add_settings_of_tests(named: dict[str, dict[str, Floats]], about: tuple[str, ...]) -> None:
    """Add numbers that differ between alike structs, such as the load of each test, as columns."""
    numbers: dict[str, dict[str, float]] = {}
    for line in about:
        place, _, text = line.partition(" = ")
        parent, _, name = place.rpartition(".")
        try:
            numbers.setdefault(name, {})[parent] = read_number(text)
        except ValueError:
            continue
    for name, by_struct in numbers.items():
        own = [parent for parent in named if parent in by_struct and name not in named[parent]]
        if len(set(by_struct.values())) < 2 or len(own) < len(named):
            continue
        for parent in own:
            length = len(next(iter(named[parent].values())))
            named[parent][name] = np.full(length, by_struct[parent])


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


def _version_5_leaves(path: Path) -> tuple[list[tuple[str, Any]], tuple[str, ...]]:
    need("scipy", "import")
    from scipy.io import loadmat

    check_matlab_size(path)
    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except Exception as error:  # scipy raises many kinds for damaged files
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path} is not a complete MATLAB file: {first}") from None
    leaves: list[tuple[str, Any]] = []
    about: list[str] = []

    def walk(place: str, value: Any, depth: int) -> None:
        if depth > _DEEPEST:
            return
        if hasattr(value, "_fieldnames"):
            for name in value._fieldnames:
                walk(f"{place}.{name}", getattr(value, name), depth + 1)
        elif isinstance(value, np.ndarray) and value.dtype == object:
            for i, element in enumerate(value.reshape(-1)):
                walk(f"{place}_{i + 1}", element, depth + 1)
        elif isinstance(value, np.ndarray) and _is_samples(value):
            leaves.append((place, value))
        elif isinstance(value, str) or np.ndim(value) == 0:
            about.append(f"{place} = {value}")

    for name, value in content.items():
        if not name.startswith("__"):
            walk(name, value, 0)
    return leaves, tuple(about)


def _hdf5_leaves(path: Path) -> tuple[list[tuple[str, Any]], tuple[str, ...]]:
    try:
        import h5py
    except ImportError:
        raise InputError(
            f"{path} is an HDF5 file, as MATLAB 7.3 writes them, which needs h5py: pip install "
            "'.[logs]'; or save it in MATLAB with save(..., '-v7')"
        ) from None
    leaves: list[tuple[str, Any]] = []
    about: list[str] = []

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
        place = name.replace("/", ".")
        if item.dtype.kind in "iufb" and item.attrs.get("MATLAB_class", b"") != b"char":
            values = np.squeeze(np.asarray(item))
            if _is_samples(values):
                leaves.append((place, values))
            elif values.ndim == 0:
                about.append(f"{place} = {values}")

    try:
        with h5py.File(path, "r") as opened:
            opened.visititems(visit)
    except InputError:
        raise
    except Exception as error:  # h5py raises many kinds for damaged files
        first = " ".join(str(error).split())
        raise InputError(f"{path} is not a complete HDF5 file: {first}") from None
    return leaves, tuple(about)
