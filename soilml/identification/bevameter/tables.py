"""Tables of plate-sinkage and shear tests, read as curves of stress."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import TableError
from soilml.io.table import Table

#: Most points of a curve that are kept: means over equal steps of its abscissa, so that neither a
#: slow part of a test nor a high sampling rate counts more than the rest.
MOST_POINTS = 25
#: Points of a loading curve that an exponent needs (two for the line, one to see a misfit), and of
#: a shear curve that its two parameters need.
PLATE_POINTS, SHEAR_POINTS = 3, 2
SAME_SIZE = 0.01  # Variation of a plate's size within a test above which the rows are not one test
MOST_STRENGTHS = 10  # Rows of one name and one normal stress that are strengths of repeats


@dataclass(frozen=True)
class StressCurve:
    """One test: stress (Pa) over sinkage or shear displacement (m), (k,) each.

    level: Of a plate test the smaller dimension of the plate (m): the radius of a round one, the
        width of a rectangular one. Of a shear test the mean normal stress (Pa).
    x: A shear displacement is infinite where the stress is that of the steady end of the test, or
        its strength where no curve was recorded.
    omitted: Samples without stress, without sinkage, or less deep than an earlier one.
    """

    name: str
    level: float
    x: Floats
    stress: Floats
    omitted: int = 0

    @property
    def has_curve(self) -> bool:
        """Whether stresses were recorded over displacements."""
        return bool(np.isfinite(self.x).any())


def read_plate_tests(table: Table) -> list[StressCurve]:
    """The loading curves of a table of plate-sinkage tests, in at most `MOST_POINTS` points each.

    table: Rows with `test`, `sinkage_m`, the plate as `plate_radius_m`, as `plate_width_m` and
        `plate_length_m`, or as `plate_area_m2` (of a round plate), and `pressure_Pa` or `load_N`.

    Raises `TableError`, which names the missing column, or the test without a usable curve.
    """
    size, area = _plate(table)
    if "pressure_Pa" not in table and "load_N" not in table:
        raise TableError(f"{table.source}: column pressure_Pa is missing; pressure_Pa or load_N is")
    pressure = table["pressure_Pa"] if "pressure_Pa" in table else table["load_N"] / area
    sinkage, tests = table["sinkage_m"], []
    for name, rows in _rows_of_tests(table, table["test"]):
        own, z, p = size[rows], sinkage[rows], pressure[rows]
        if np.ptp(own) > SAME_SIZE * own.mean():
            raise TableError(
                f"{table.source}: test {name} has plates of {own.min():g} and {own.max():g} m; "
                "give each plate a test of its own"
            )
        usable = np.isfinite(z) & np.isfinite(p) & (z > 0.0) & (p > 0.0)
        z, p = z[usable], p[usable]
        deeper = z > np.maximum.accumulate(np.append(0.0, z))[:-1]
        z, p = z[deeper], p[deeper]
        if np.unique(z).size < PLATE_POINTS:
            raise TableError(
                f"{table.source}: test {name} needs {PLATE_POINTS} or more samples with growing "
                f"sinkage and a pressure above zero; it has {z.size}"
            )
        tests.append(StressCurve(name, float(own[0]), *_thinned(z, p), rows.size - z.size))
    return tests


def read_shear_tests(table: Table) -> list[StressCurve]:
    r"""The tests of a table of shear tests with a plate, a box or a ring.

    .. math::
        \tau = \frac{3 T}{2 \pi (r_o^3 - r_i^3)}, \quad j = \frac{r_o + r_i}{2} \alpha, \quad
        \sigma = \frac{W}{\pi (r_o^2 - r_i^2)}

    for a ring that is rotated by an angle alpha with the torque T under the load W; the stress is
    taken as constant over the ring. A row whose displacement or angle is blank holds the steady
    shear stress at the end of the test. Where no row has one, each row is a test of its own, with
    its strength or largest torque, as most shear cells give it.

    table: Rows with `test`, and either `normal_stress_Pa`, `shear_stress_Pa` and
        `shear_displacement_m`, or `inner_radius_m`, `outer_radius_m`, `torque_Nm`, `angle_rad` and
        `load_N` (or `normal_stress_Pa`). Displacement and angle may be missing.

    Raises `TableError`, which names the missing column, or the test without a usable curve.

    References: Wong, Theory of Ground Vehicles, 2008, section 2.4, shear ring.
    """
    displacement, stress, normal = _shear_columns(table)
    names = np.asarray(table["test"])
    if len(table) and not np.isfinite(displacement).any():
        _refuse_lost_curves(table, normal)
        given = names.tolist()
        names = np.asarray(
            [
                f"{name} {given[: i + 1].count(name)}" if given.count(name) > 1 else name
                for i, name in enumerate(given)
            ]
        )
    tests = []
    for name, rows in _rows_of_tests(table, names):
        sigma = normal[rows]
        sigma = sigma[np.isfinite(sigma)]
        if sigma.size == 0 or sigma.mean() <= 0.0:
            raise TableError(f"{table.source}: test {name} has no normal stress above zero")
        j = np.where(np.isnan(displacement[rows]), np.inf, displacement[rows])
        usable = np.isfinite(stress[rows]) & (j > 0.0)
        j, tau = j[usable], stress[rows][usable]
        curve = np.isfinite(j)
        if np.unique(j).size < (SHEAR_POINTS if curve.any() else 1) or not np.any(tau > 0.0):
            raise TableError(
                f"{table.source}: test {name} needs {SHEAR_POINTS} or more samples with a "
                f"displacement and a shear stress above zero; it has {j.size}"
            )
        if curve.any():
            thin = _thinned(j[curve], tau[curve])
            j, tau = (np.append(a, b[~curve]) for a, b in zip(thin, (j, tau), strict=True))
        else:
            j, tau = np.asarray([np.inf]), np.asarray([tau.mean()])
        tests.append(StressCurve(name, float(sigma.mean()), j, tau))
    return tests


def _rows_of_tests(
    table: Table, names: NDArray[np.str_]
) -> Iterator[tuple[str, NDArray[np.int64]]]:
    """Name and rows of each test, in the order of the table; `TableError` for an empty one."""
    if len(table) == 0:
        raise TableError(f"{table.source}: the table has no row")
    for name in dict.fromkeys(np.asarray(names).tolist()):
        yield str(name), np.flatnonzero(names == name)


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


def _thinned(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """The points of a curve; means over `MOST_POINTS` equal steps of x where there are more."""
    if x.size <= MOST_POINTS:
        return x, y
    step = np.minimum((x / x.max() * MOST_POINTS).astype(np.int64), MOST_POINTS - 1)
    count = np.bincount(step, minlength=MOST_POINTS)
    kept = count > 0
    steps = (np.bincount(step, v, MOST_POINTS)[kept] / count[kept] for v in (x, y))
    return next(steps), next(steps)


def _refuse_lost_curves(table: Table, normal: Floats) -> None:
    """Raise `TableError` where a test has so many rows that these are samples of its curve."""
    pairs = list(zip(table["test"].tolist(), normal.tolist(), strict=True))
    for name, stress in dict.fromkeys(pairs):
        if (count := pairs.count((name, stress))) > MOST_STRENGTHS:
            key = "angle_rad" if "torque_Nm" in table else "shear_displacement_m"
            raise TableError(
                f"{table.source}: column {key} is missing: {count} rows of test {name} are samples "
                "of a curve; for strengths alone, give each test one row"
            )


def _shear_columns(table: Table) -> tuple[Floats, Floats, Floats]:
    """Displacement (m), shear stress and normal stress (Pa) of each row."""

    def needed(key: str, text: str) -> Floats:
        if key not in table:
            found = ", ".join(table.columns)
            raise TableError(f"{table.source}: column {key} is missing ({text}); found: {found}")
        return np.asarray(table[key], float)

    def or_blank(key: str) -> Floats:
        return np.asarray(table[key], float) if key in table else np.full(len(table), np.nan)

    if "torque_Nm" not in table:
        stress = needed("shear_stress_Pa", "or those of a ring: torque_Nm, angle_rad, ...")
        normal = needed("normal_stress_Pa", "the normal stress of each row")
        return or_blank("shear_displacement_m"), stress, normal
    inner, outer = (
        needed(key, "for a ring, with torque_Nm") for key in ("inner_radius_m", "outer_radius_m")
    )
    if (wrong := ~(outer > inner)).any():
        row = int(np.argmax(wrong))
        raise TableError(
            f"{table.place(row)}, column outer_radius_m: {outer[row]:g} given; needed is a "
            f"radius above inner_radius_m, {inner[row]:g}"
        )
    displacement = or_blank("angle_rad") * 0.5 * (outer + inner)
    stress = 3.0 * table["torque_Nm"] / (2.0 * np.pi * (outer**3 - inner**3))
    if "normal_stress_Pa" in table:
        return displacement, stress, np.asarray(table["normal_stress_Pa"], float)
    load = needed("load_N", "or normal_stress_Pa")
    return displacement, stress, load / (np.pi * (outer**2 - inner**2))
