"""Tables of plate and shear tests under other names and in other units."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from soilml.errors import InputError, SoilmlError
from soilml.io.table import Table, text_column
from soilml.log_import.guesses.columns import words_of
from soilml.log_import.readers import read_log
from soilml.log_import.recording import Recording
from soilml.log_import.units import dimension, factor, unit_in_name
from soilml.quantities import COLUMNS

#: Words of the columns of a table of shear tests, and of a ring.
_SHEAR = {"tau", "shear", "scher", "scherspannung", "schub", "taglio", "corte", "cisaillement"}
_RING = {"angle", "winkel", "theta", "rotation"}
#: Our column, its unit, and the words of which a name must have one; the first that fits counts.
_QUANTITIES: tuple[tuple[str, str, set[str]], ...] = (
    ("shear_stress_Pa", "Pa", _SHEAR | {"t", "strength"}),
    ("normal_stress_Pa", "Pa", {"sigma", "normal", "normalspannung", "sn", "s", "vertical"}),
    ("pressure_Pa", "Pa", {"p", "pressure", "druck", "contact", "stress", "q"}),
    ("shear_displacement_m", "m", _SHEAR | {"j", "x", "horizontal", "scherweg"}),
    ("inner_radius_m", "m", {"inner", "innen", "ri"}),
    ("outer_radius_m", "m", {"outer", "aussen", "außen", "ro", "ra"}),
    ("plate_diameter", "m", {"d", "diameter", "dia", "durchmesser"}),
    ("plate_radius_m", "m", {"r", "radius", "b"}),
    ("plate_width_m", "m", {"width", "breite", "w"}),
    ("plate_length_m", "m", {"length", "länge", "laenge", "l"}),
    ("sinkage_m", "m", {"z", "sinkage", "depth", "penetration", "einsinkung", "tiefe", "h"}),
    ("displacement", "m", {"displacement", "verschiebung", "weg", "travel"}),
    ("plate_area_m2", "m^2", {"area", "fläche", "flaeche", "a"}),
    ("load_N", "N", {"load", "force", "f", "w", "fz", "kraft", "last", "n"}),
    ("torque_Nm", "N m", {"torque", "moment", "t", "m", "drehmoment"}),
    ("angle_rad", "rad", _RING),
)
#: Columns by which a table is one of tests, and not of the runs of a wheel.
_OF_TESTS = (
    {"shear_stress_Pa"}, {"torque_Nm", "angle_rad"}, {"torque_Nm", "outer_radius_m"},
    {"pressure_Pa"},
)  # fmt: skip
#: Words of stresses and torques beside those of the strength.
_SECOND = {"pre", "preshear", "consolidation", "consol", "residual", "rest", "ultimate", "end"}
_PLATES = {"plate_radius_m", "plate_diameter", "plate_width_m", "plate_area_m2"}
_TEST = {"test", "run", "trial", "probe", "sample", "versuch", "specimen", "no", "id", "name"}


@dataclass(frozen=True)
class SoilTests:
    """A table of tests in the columns of soilml, what was taken for what, and what was left out."""

    table: Table
    taken: tuple[str, ...]
    left_out: tuple[str, ...]

    def __str__(self) -> str:
        text = f"{self.table.source} is read as {', '.join(self.taken)}"
        return text + (f"; left out: {', '.join(self.left_out)}" if self.left_out else "")


def read_soil_tests(path: str | os.PathLike[str]) -> SoilTests | None:
    """Plate or shear tests whose columns have other names and state their units.

    None where the columns are those of soilml, where none is of tests, and where the file cannot
    be read.

    Raises `InputError` where a column that seems to be of tests states no unit.
    """
    try:
        recordings = read_log(Path(path))
    except SoilmlError:
        return None
    if len(recordings) != 1 or not recordings[0].columns:
        return None
    own = recordings[0]
    if any(name.removesuffix("_std") in COLUMNS for name in own.columns):
        return None
    found: dict[str, np.ndarray] = {}
    taken, left_out = [], []
    # of two stresses, the strength comes before the residual one, and the shearing before what
    # consolidated the sample
    ordered = sorted(own.columns.items(), key=lambda c: bool({*words_of(c[0])} & _SECOND))
    for name, values in ordered:
        unit = own.units.get(name, "")
        unit = unit if dimension(unit) else unit_in_name(name)
        words = {*words_of(name)}
        column = _quantity(words, dimension(unit) if unit else None, {*found})
        if column and not unit:
            raise InputError(
                f"{path}: the column {name!r} states no unit; needed is one in its name, such as "
                f"'{name} [mm]' or '{name} [kPa]', or the columns of `soilml bevameter --help`"
            )
        if column:
            ours = next(u for c, u, _ in _QUANTITIES if c == column)
            found[column] = values * factor(unit, ours, f"{path}, column {name!r}")
            taken.append(f"{_our_name(column, own)} = {name!r} ({unit})")
        elif not (words & _TEST and "test" not in found):
            left_out.append(repr(name))
    plates = "load_N" in found and bool(_PLATES & found.keys())
    if not plates and not any(needed <= found.keys() for needed in _OF_TESTS):
        return None
    label, names = _names(own)
    taken.insert(0, f"test = {label!r}" if label else "one test")
    if "plate_diameter" in found:
        found["plate_radius_m"] = found.pop("plate_diameter") / 2.0
    if "displacement" in found:
        found[_our_name("displacement", own)] = found.pop("displacement")
    tests = text_column(names, lambda i: f"{path}, row {i + 1} of the tests, column {label!r}")
    columns = {"test": tests, **found}
    lines = np.arange(1, len(own) + 1)
    return SoilTests(Table(columns, str(path), lines), tuple(taken), tuple(left_out))


def _quantity(words: set[str], kind: str | None, have: set[str]) -> str:
    """The column that a name and the kind of its unit mean; "" for none.

    Without a unit only words of more than one letter count, so that the column is asked for it.
    """
    for column, unit, known in _QUANTITIES:
        if column in have or (kind is not None and kind != unit):
            continue
        if words & {word for word in known if kind is not None or len(word) > 4}:
            return column
    return ""


def _our_name(column: str, own: Recording) -> str:
    """The name in soilml; a displacement is that of the shear where there is a shear stress."""
    if column == "plate_diameter":
        return "2 plate_radius_m"
    if column != "displacement":
        return column
    sheared = any({*words_of(name)} & _SHEAR for name in own.columns)
    return "shear_displacement_m" if sheared else "sinkage_m"


def _names(own: Recording) -> tuple[str, list[str]]:
    """The column that names the test of each row, and the names."""
    for name, cells in own.texts.items():
        if {*words_of(name)} & _TEST or len(own.texts) == 1:
            return name, [cell or "unnamed" for cell in cells]
    for name, values in own.columns.items():
        if {*words_of(name)} & _TEST and np.isfinite(values).all():
            return name, [f"{value:g}" for value in values]
    return "", ["test"] * len(own)
