"""Shear tests in a table: a normal stress and a shear curve for each test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.errors import TableError
from soilml.identification.bevameter.plate_tests import MOST_POINTS
from soilml.io.table import Table

Floats = NDArray[np.float64]

#: Points of a shear curve that its two parameters need.
LEAST_POINTS = 2


@dataclass(frozen=True)
class ShearTest:
    """One test: mean normal stress (Pa), and shear stress (Pa) at displacements (m), (k,) each.

    A displacement is infinite where the stress is that of the steady end of the test.
    """

    name: str
    normal_stress: float
    displacement: Floats
    stress: Floats
    #: largest relative deviation of the normal stress from its mean
    normal_variation: float


def read_shear_tests(table: Table) -> list[ShearTest]:
    r"""The tests of a table of shear tests with a plate, a box or a ring.

    .. math::
        \tau = \frac{3 T}{2 \pi (r_o^3 - r_i^3)}, \quad j = \frac{r_o + r_i}{2} \alpha, \quad
        \sigma = \frac{W}{\pi (r_o^2 - r_i^2)}

    for a ring that is rotated by an angle alpha with the torque T under the load W; the stress is
    taken as constant over the ring. A row whose displacement or angle is blank holds the steady
    shear stress at the end of the test.

    Parameters
    ----------
    table
        Rows with `test`, and either `normal_stress_Pa`, `shear_displacement_m`, `shear_stress_Pa`,
        or `inner_radius_m`, `outer_radius_m`, `angle_rad`, `torque_Nm`, `load_N` (or
        `normal_stress_Pa`).

    Raises
    ------
    TableError
        Names the column that is missing, or the test that has no usable curve.

    References
    ----------
    Wong, Theory of Ground Vehicles, 2008, section 2.4, shear ring.
    """
    if len(table) == 0:
        raise TableError(f"{table.source}: the table has no row")
    displacement, stress, normal = _curves(table)
    tests = []
    for name in dict.fromkeys(table["test"].tolist()):
        rows = table["test"] == name
        sigma = normal[rows]
        sigma = sigma[np.isfinite(sigma)]
        if sigma.size == 0 or sigma.mean() <= 0.0:
            raise TableError(f"{table.source}: test {name} has no normal stress above zero")
        tests.append(_test(table, name, displacement[rows], stress[rows], sigma))
    return tests


def _curves(table: Table) -> tuple[Floats, Floats, Floats]:
    """Displacement (m), shear stress and normal stress (Pa) of each row."""
    ring = "torque_Nm" in table
    if ring:
        for key in ("inner_radius_m", "outer_radius_m", "angle_rad"):
            _require(table, key, "for a ring, with torque_Nm")
        inner, outer = table["inner_radius_m"], table["outer_radius_m"]
        if (wrong := ~(outer > inner)).any():
            row = int(np.argmax(wrong))
            raise TableError(
                f"{table.place(row)}, column outer_radius_m: {outer[row]:g} given; needed is a "
                f"radius above inner_radius_m, {inner[row]:g}"
            )
        displacement = table["angle_rad"] * 0.5 * (outer + inner)
        stress = 3.0 * table["torque_Nm"] / (2.0 * np.pi * (outer**3 - inner**3))
    else:
        for key in ("shear_displacement_m", "shear_stress_Pa"):
            _require(table, key, "or those of a ring: torque_Nm, angle_rad, ...")
        displacement, stress = table["shear_displacement_m"], table["shear_stress_Pa"]
    if "normal_stress_Pa" in table:
        return displacement, stress, table["normal_stress_Pa"]
    if not ring:
        _require(table, "normal_stress_Pa", "the normal stress of each row")
    _require(table, "load_N", "or normal_stress_Pa")
    return displacement, stress, table["load_N"] / (np.pi * (outer**2 - inner**2))


def _require(table: Table, key: str, text: str) -> None:
    if key not in table:
        found = ", ".join(table.columns)
        raise TableError(f"{table.source}: column {key} is missing ({text}); found: {found}")


def _test(
    table: Table, name: str, displacement: Floats, stress: Floats, sigma: Floats
) -> ShearTest:
    j = np.where(np.isnan(displacement), np.inf, displacement)
    usable = np.isfinite(stress) & (j > 0.0)
    j, stress = j[usable], stress[usable]
    if np.unique(j).size < LEAST_POINTS or not np.any(stress > 0.0):
        raise TableError(
            f"{table.source}: test {name} needs {LEAST_POINTS} or more samples with a displacement "
            f"and a shear stress above zero; it has {j.size}"
        )
    curve = np.isfinite(j)
    if np.count_nonzero(curve) > MOST_POINTS:
        end = j[curve].max()
        step = np.minimum((j[curve] / end * MOST_POINTS).astype(np.int64), MOST_POINTS - 1)
        count = np.bincount(step, minlength=MOST_POINTS)
        kept = count > 0
        means = [np.bincount(step, v[curve], MOST_POINTS)[kept] / count[kept] for v in (j, stress)]
        j = np.append(means[0], j[~curve])
        stress = np.append(means[1], stress[~curve])
    mean = float(sigma.mean())
    return ShearTest(name, mean, j, stress, float(np.abs(sigma / mean - 1.0).max()))
