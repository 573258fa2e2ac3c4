"""Tables of plate and shear tests under other names and in other units."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from unicodedata import combining, normalize

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError, SoilmlError
from soilml.io.table import TEXT, Table, text_column
from soilml.log_import.guesses.constants import agreed_constants, stated_radius
from soilml.log_import.guesses.role_words import parts_of, words_of
from soilml.log_import.readers import read_log
from soilml.log_import.recording import Recording
from soilml.log_import.units import dimension, factor, unit_in_name
from soilml.optional_imports import tomllib
from soilml.quantities import COLUMNS

_STEM = 4  # Fewest letters of a word that others may begin with
#: Columns by which a table is one of tests, and not of the runs of a wheel.
_OF_TESTS = (
    {"shear_stress_Pa"}, {"torque_Nm", "angle_rad"}, {"torque_Nm", "outer_radius_m"},
    {"pressure_Pa"}, {"load_N", "plate_radius_m"}, {"load_N", "plate_width_m"},
    {"load_N", "plate_area_m2"},
)  # fmt: skip
#: Columns that a simulator with z upward has below zero.
_UPWARD = ("sinkage_m", "displacement", "load_N")
_PLATES = ("plate_radius_m", "plate_width_m", "plate_area_m2")
#: What no column beside a shear stress is.
_OF_A_PLATE = ("plate_length_m", "sinkage_m", *_PLATES[:2])
#: How far a test advances, what is constant in it, and the share by which these jump to the next.
_ADVANCE = ("shear_displacement_m", "sinkage_m", "angle_rad")
_CONSTANT, _BACK, _OTHER, _SELDOM = ("normal_stress_Pa", *_PLATES), 0.5, 0.1, 0.25


@cache
def _known() -> tuple[dict[str, tuple[str, tuple[str, ...]]], dict[str, tuple[str, ...]]]:
    """Unit and words of each of our columns, and other words by name, from the file beside this."""
    found = tomllib.loads(Path(__file__).with_name("test_words.toml").read_text(encoding="utf-8"))
    words = {name: tuple(own) for name, own in found["words"].items()}

    def all_of(own: Sequence[str]) -> tuple[str, ...]:
        return tuple(w for one in own for w in (words[one[1:]] if one[0] == "*" else (one,)))

    return {name: (own[0], all_of(own[1:])) for name, own in found["quantities"].items()}, words


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

    A second column of a quantity that is taken is left out. Without a column that names the test, a
    new one begins where the displacement starts again, or the stress or the plate is another one.

    None where the columns are those of soilml, where none is of tests, and where the file cannot
    be read.

    Raises `InputError` where a column that seems to be of tests states no unit, and for vane and
    triaxial tests.
    """
    try:
        recordings = read_log(Path(path))
    except SoilmlError:
        return None
    own, name = recordings[0], str(path)
    if len(recordings) != 1 or not own.columns:
        return None
    if any(n not in TEXT and n.removesuffix("_std") in COLUMNS for n in own.columns):
        return None
    if kind := _other_kind(own):
        raise InputError(
            f"{name}: {kind} tests are not read; needed are plate or shear tests: of triaxial "
            "tests, give cohesion and friction_angle in [soil]"
        )
    sheared = any(_says(n, "shear", "across") for n in own.columns)
    found, taken, left_out = _taken(name, own, sheared)
    _complete(name, own, found, taken)
    if not any(needed <= found.keys() for needed in _OF_TESTS):
        return None
    label, names = _names(own, found)
    count = len({*names})
    counted = "one test" if count == 1 else f"{count} tests, divided where they start again"
    taken.insert(0, f"test = {label!r}" if label else counted)
    tests = text_column(names, lambda i: f"{name}, row {i + 1} of the tests, column {label!r}")
    columns, lines = {"test": tests, **found}, np.arange(1, len(own) + 1)
    return SoilTests(Table(columns, name, lines), tuple(taken), tuple(left_out))


def _taken(
    path: str, own: Recording, sheared: bool
) -> tuple[dict[str, Floats], list[str], list[str]]:
    """Our columns, what was taken for what, and what was left out."""
    found: dict[str, Floats] = {}
    taken, left_out = [], []
    # of two stresses, the strength comes before the residual one, and the shearing before what
    # consolidated the sample
    for name, values in sorted(own.columns.items(), key=lambda c: _says(c[0], "second")):
        unit = _unit(own, name)
        kind = dimension(unit) if unit else None
        weight = 9.80665 if kind == "kg" else 1.0  # a scale that shows the force in kg
        column, ours = _quantity(name, "N" if kind == "kg" else kind, {*found}, sheared)
        if not column:
            if not _says(name, "test"):
                left_out.append(repr(name))
            continue
        if not unit:
            raise InputError(
                f"{path}: the column {name!r} states no unit; needed is one in its name, such as "
                f"'{name} [mm]' or '{name} [kPa]', or the columns of `soilml bevameter --help`"
            )
        half = column.endswith("_radius_m") and (
            _says(name, "diameter") or {*words_of(name)} & {"id", "od"}
        )
        share = weight * (0.5 if half else 1.0)
        if column in _UPWARD and np.any(values) and not np.any(values > 0.0):
            share = -share
        size = factor(unit, "kg" if kind == "kg" else ours, f"{path}, column {name!r}")
        column = _of_displacement(sheared) if column == "displacement" else column
        found[column] = share * values * size
        sign = "-" * (share < 0.0) + "2 " * bool(half)
        taken.append(f"{sign}{column} = {name!r} ({unit})")
    return found, taken, left_out


def _complete(path: str, own: Recording, found: dict[str, Floats], taken: list[str]) -> None:
    """Add what follows from the columns: the size of a plate, and stresses from forces."""
    if "plate_radius_m" in found and "plate_length_m" in found and "plate_width_m" not in found:
        found["plate_width_m"] = found.pop("plate_radius_m")  # b of a strip is its width
    if "pressure_Pa" in found and "plate_width_m" in found:
        found.setdefault("plate_length_m", found["plate_width_m"])  # a pressure needs no area
    if "sinkage_m" in found and not {*_PLATES} & found.keys():
        if radius := stated_radius(agreed_constants([[own]]).common):
            found["plate_radius_m"] = np.full(len(own), radius)
            taken.append(f"plate_radius_m = {radius:g} m, as the file or its name states")
        elif "load_N" in found and any(_says(name, "plates") for name in own.columns):
            raise InputError(
                f"{path}: the size of the plate is missing; needed is a column such as "
                "'plate radius [mm]', or a line before the header, such as '# plate radius: 50 mm'"
            )
    if "shear_force" in found:
        if "plate_area_m2" not in found:
            raise InputError(
                f"{path}: forces of a shear box need its area: a column such as 'area [cm^2]'"
            )
        area = found.pop("plate_area_m2")
        for force, stress in (("shear_force", "shear_stress_Pa"), ("load_N", "normal_stress_Pa")):
            if force in found:
                found[stress] = found.pop(force) / area


def _other_kind(own: Recording) -> str:
    """The kind of tests of a table that are not read; "" of others.

    A triaxial test has the stress of its cell, and beside it the axial one or the deviator.
    """
    if any(_says(n, "vane") for n in own.columns):
        return "vane"
    stresses = [n for n in own.columns if dimension(_unit(own, n)) == "Pa"]
    words = [{*words_of(n)} for n in stresses]
    axes = {*"13"} & {w for of_one in words if of_one & {"sigma", "σ", "s"} for w in of_one}
    of_cell = "3" in axes or any(_says(n, "confining") for n in stresses)
    along = "1" in axes or any(_says(n, "deviator") for n in stresses)
    return "triaxial" if of_cell and along else ""


def _unit(own: Recording, name: str) -> str:
    unit = own.units.get(name, "")
    return unit if dimension(unit) else unit_in_name(name)


def _says(name: str, *groups: str) -> bool:
    """Whether a name has a word of these groups."""
    return any(_has(name, _known()[1][group]) for group in groups)


def _has(name: str, known: Sequence[str], shortest: int = 1) -> bool:
    """Whether a name has one of these words, or a word of `shortest` letters that begins so."""
    words = {*parts_of(words_of(name)), *words_of(name), "".join(words_of(name))}
    plain = ["".join(c for c in normalize("NFKD", w.casefold()) if not combining(c)) for w in words]
    return any(
        word == start or (len(start) >= _STEM and word.startswith(start)) if start.isascii()
        else normalize("NFKD", start) in word
        for word in plain if len(word) >= shortest or not word.isascii()
        for start in known
    )  # fmt: skip


def _quantity(name: str, kind: str | None, have: set[str], sheared: bool) -> tuple[str, str]:
    """The column that a name and the kind of its unit mean, and our unit; "" for none, and for one
    that is taken.

    Without a unit only words of some letters count, so that the column is asked for it. Beside a
    shear stress a vertical displacement is none of the shear, and no length is of a plate.
    """
    across = _says(name, "vertical") or {*words_of(name)} & {"normal", "v"}
    if sheared and across and (kind == "m" or (kind is None and _says(name, "ways"))):
        return "", ""
    for column, (unit, known) in _known()[0].items():
        if sheared and column in _OF_A_PLATE:
            continue
        if kind not in (None, unit) or not _has(name, known, _STEM + 1 if kind is None else 1):
            continue
        ours = _of_displacement(sheared) if column == "displacement" else column
        if ours not in have:
            return column, unit
        if column == "displacement" or (
            _says(name, "shear", "second", "vertical") and kind == "Pa"
        ):
            break
    return "", ""


def _of_displacement(sheared: bool) -> str:
    """What a displacement is: that of the shear where there is a shear stress."""
    return "shear_displacement_m" if sheared else "sinkage_m"


def _names(own: Recording, found: dict[str, Floats]) -> tuple[str, list[str]]:
    """The column that names the test of each row, "" for none, and the names."""
    for name, cells in own.texts.items():
        if _says(name, "test") or len(own.texts) == 1:
            return name, [cell or "unnamed" for cell in cells]
    curves = any(name in found for name in (*_ADVANCE, "pressure_Pa"))
    for name, values in own.columns.items():
        # it numbers tests and not samples: of strengths each row is a test
        in_groups = not curves or np.unique(values).size < values.size
        if in_groups and _says(name, "test") and np.isfinite(values).all():
            return name, [f"{value:g}" for value in values]
    # of strengths without a curve each row is a test
    number = np.cumsum(_starts(found, len(own))) if curves else np.arange(len(own))
    several = number.size and number[-1] > 0
    return "", [f"{own.file.stem}_{n + 1}" if several else own.file.stem for n in number]


def _starts(found: dict[str, Floats], count: int) -> np.ndarray:
    """Whether a new test starts at each row (rows,)."""
    starts = np.zeros(count, dtype=bool)
    advance = next((np.abs(found[name]) for name in _ADVANCE if name in found), None)
    if advance is not None and count > 1:
        size = np.maximum.accumulate(np.nan_to_num(advance))[:-1]
        starts[1:] |= np.diff(advance) < -_BACK * size
        for own in (found[name] for name in _CONSTANT if name in found):
            jumps = np.abs(np.diff(own)) > _OTHER * np.abs(own[:-1])
            starts[1:] |= jumps & (np.mean(jumps) < _SELDOM)
    return starts
