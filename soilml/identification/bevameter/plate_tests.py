"""Plate-sinkage tests in a table: one loading curve for each test."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.errors import TableError
from soilml.io.table import Table

Floats = NDArray[np.float64]

#: Most points of a curve that are kept: means over equal steps of sinkage, so that neither a slow
#: part of a test nor a high sampling rate counts more than the rest.
MOST_POINTS = 25
#: Points of the loading curve that an exponent needs: two for the line, one to see a misfit.
LEAST_POINTS = 3
#: Variation of a plate's size within a test above which the rows are not one test.
SAME_SIZE = 0.01


@dataclass(frozen=True)
class PlateTest:
    """The loading curve of one test: mean pressure (Pa) at sinkages (m), (k,) each.

    `size` is the smaller dimension of the plate (m): the radius of a round one, the width of a
    rectangular one. `omitted` counts the samples without pressure, without sinkage, or less deep
    than an earlier one.
    """

    name: str
    size: float
    sinkage: Floats
    pressure: Floats
    omitted: int


def read_plate_tests(table: Table) -> list[PlateTest]:
    """The tests of a table of plate-sinkage tests.

    Parameters
    ----------
    table
        Rows with `test`, `sinkage_m`, the plate as `plate_radius_m`, as `plate_width_m` and
        `plate_length_m`, or as `plate_area_m2` (of a round plate), and `pressure_Pa` or `load_N`.

    Raises
    ------
    TableError
        Names the column that is missing, or the test that has no usable curve.
    """
    if len(table) == 0:
        raise TableError(f"{table.source}: the table has no row")
    size, area = _plate(table)
    if "pressure_Pa" in table:
        pressure = table["pressure_Pa"]
    elif "load_N" in table:
        pressure = table["load_N"] / area
    else:
        raise TableError(f"{table.source}: column pressure_Pa is missing; pressure_Pa or load_N is")
    sinkage = table["sinkage_m"]
    tests = []
    for name, rows in _rows_of_tests(table):
        own = size[rows]
        if np.ptp(own) > SAME_SIZE * own.mean():
            raise TableError(
                f"{table.source}: test {name} has plates of {own.min():g} and {own.max():g} m; "
                "give each plate a test of its own"
            )
        tests.append(_loading_curve(table, name, float(own[0]), sinkage[rows], pressure[rows]))
    return tests


def _rows_of_tests(table: Table) -> list[tuple[str, NDArray[np.int64]]]:
    names, first = np.unique(table["test"], return_index=True)
    return [(str(n), np.flatnonzero(table["test"] == n)) for n in names[np.argsort(first)]]


def _plate(table: Table) -> tuple[Floats, Floats]:
    """Smaller dimension (m) and area (m^2) of the plate in each row."""
    shapes: dict[tuple[str, ...], Callable[..., tuple[Floats, Floats]]] = {
        ("plate_radius_m",): lambda r: (r, np.pi * r**2),
        ("plate_width_m", "plate_length_m"): lambda b, m: (np.minimum(b, m), b * m),
        ("plate_area_m2",): lambda a: (np.sqrt(a / np.pi), a),
    }
    for keys, dimensions in shapes.items():
        if all(key in table for key in keys):
            return dimensions(*(table[key] for key in keys))
    raise TableError(
        f"{table.source}: the size of the plate is missing; needed is plate_radius_m, or "
        "plate_area_m2 of a round plate, or plate_width_m and plate_length_m"
    )


def _loading_curve(
    table: Table, name: str, size: float, sinkage: Floats, pressure: Floats
) -> PlateTest:
    """The samples that are deeper than all before, in at most `MOST_POINTS` points."""
    usable = np.isfinite(sinkage) & np.isfinite(pressure) & (sinkage > 0.0) & (pressure > 0.0)
    z, p = sinkage[usable], pressure[usable]
    deeper = z > np.maximum.accumulate(np.append(0.0, z))[:-1]
    z, p = z[deeper], p[deeper]
    if np.unique(z).size < LEAST_POINTS:
        raise TableError(
            f"{table.source}: test {name} needs {LEAST_POINTS} or more samples with growing "
            f"sinkage and a pressure above zero; it has {z.size}"
        )
    omitted = sinkage.size - z.size
    if z.size > MOST_POINTS:
        step = np.minimum((z / z[-1] * MOST_POINTS).astype(np.int64), MOST_POINTS - 1)
        count = np.bincount(step, minlength=MOST_POINTS)
        kept = count > 0
        z = np.bincount(step, z, MOST_POINTS)[kept] / count[kept]
        p = np.bincount(step, p, MOST_POINTS)[kept] / count[kept]
    return PlateTest(name, size, z, p, omitted)
