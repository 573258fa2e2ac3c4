"""The rigid wheel in C, compiled on this machine: what the arithmetic takes without numpy."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from soilml.numerics.quadrature import crowded_start
from soilml.physics.gears.wheel import COARSE_NODES, DRIVING_NODES

Floats = np.ndarray[Any, np.dtype[np.float64]]

SOURCE = Path(__file__).with_name("peers_wheel.c")
#: In the order of the columns in the source.
COLUMNS = (
    *("radius", "width", "cohesion", "friction_angle", "shear_modulus", "n"),
    *("kc", "kphi", "a0", "a1", "slip", "load"),
)
STRICT = ("-std=c99", "-O3", "-march=native")
#: Lets the compiler call the vector functions of the C library.
FAST = (*STRICT, "-ffast-math")

Solver = Callable[[Mapping[str, Floats | float], int], Floats]


def compiled(folder: Path, flags: tuple[str, ...]) -> Solver | None:
    """Torque (N m) of driving wheels (batch,) by their columns and the points of each part.

    None where there is no gcc.
    """
    if shutil.which("gcc") is None:
        return None
    library = folder / f"wheel{len(flags)}.so"
    command = ["gcc", *flags, "-shared", "-fPIC", str(SOURCE), "-o", str(library), "-lm"]
    subprocess.run(command, check=True)
    solve = ctypes.CDLL(str(library)).solve

    def torque(rows: Mapping[str, Floats | float], points: int = DRIVING_NODES) -> Floats:
        count = np.size(rows["load"])
        columns = np.stack([np.broadcast_to(rows[name], count) for name in COLUMNS])
        out = np.empty((4, count))
        solve(
            ctypes.c_long(count),
            _pointer(np.ascontiguousarray(columns, np.float64)),
            _pointer(out),
            *_points(COARSE_NODES),
            *_points(points),
        )
        return np.asarray(out[1])

    return torque


def _points(count: int) -> tuple[Any, ...]:
    x, weight = crowded_start(count)
    return ctypes.c_int(count), _pointer(x), _pointer(weight)


def _pointer(values: Floats) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
