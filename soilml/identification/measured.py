"""Measured rows as identification takes them: operating points, channels, and their noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.case import Case
from soilml.errors import FitError, TableError
from soilml.quantities import CHANNELS, QUANTITIES, column
from soilml.table import Table

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """Readings of one quantity, NaN where not measured, and their standard deviation."""

    name: str
    reading: Floats
    std: Floats
    declared: bool


@dataclass(frozen=True)
class Measured:
    """Rows (n,): slip and load as reported, their noise, and the channels to be explained."""

    slip: Floats
    load: Floats
    slip_std: Floats
    load_std: Floats
    channels: tuple[Channel, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def cells(self) -> int:
        """How many readings there are."""
        return sum(int(np.isfinite(c.reading).sum()) for c in self.channels)


def measured_rows(case: Case, table: Table) -> Measured:
    """What a table holds for a case; raises `TableError` for a wheel that is not the case's.

    Noise comes from `<column>_std`, else from [noise]. A channel for which neither speaks is left
    out if another is declared; if none is, all are used and their noise is estimated.
    """
    same_wheel(case, table)
    found = []
    for name in CHANNELS:
        key = column(name)
        if key not in table or not np.isfinite(table[key]).any():
            continue
        reading = table[key]
        std = np.full_like(reading, np.nan)
        if f"{key}_std" in table:
            std = table[f"{key}_std"].copy()
        if key in case.noise:
            std = np.where(np.isfinite(std), std, case.noise[key].std(reading))
        declared = bool(np.all(std[np.isfinite(reading)] > 0))
        found.append(Channel(name, reading, std, declared))
    if not found:
        raise FitError(f"{table.source}: no reading of {', '.join(map(column, CHANNELS))}")
    used = [c for c in found if c.declared] or found
    left_out = [column(c.name) for c in found if c not in used]
    return Measured(
        slip=table["slip"],
        load=table["load_N"],
        slip_std=_input_noise(case, "slip", table["slip"]),
        load_std=_input_noise(case, "load_N", table["load_N"]),
        channels=tuple(used),
        left_out=tuple(left_out),
        notes=tuple(_notes(case, table)),
    )


def _notes(case: Case, table: Table) -> list[str]:
    """What a user may have overlooked in the table."""
    said = []
    runs = len(np.unique(table["run"])) if "run" in table else 1
    if runs > 1:
        said.append(f"{runs} runs are taken for one soil")
    lugs = QUANTITIES["grouser_height"].column
    if lugs in table and np.nanmax(table[lugs], initial=0.0) > 0.0:
        height = float(np.nanmax(table[lugs]))
        if not any(effect.name == "grousers" for effect in case.model.effects):
            said.append(f"{lugs} is {height:g}, but the model has no effect grousers")
    return said


def _input_noise(case: Case, key: str, reading: Floats) -> Floats:
    if key not in case.noise:
        return np.zeros_like(reading)
    return np.asarray(case.noise[key].std(reading) + 0.0 * reading)


def same_wheel(case: Case, table: Table) -> None:
    """A table that says which wheel was driven must say the case's wheel."""
    for name in ("radius", "width"):
        key = QUANTITIES[f"wheel_{name}"].column
        size = getattr(case.model.gear, name, None)
        if key not in table or size is None:
            continue
        wrong = np.abs(table[key] / size - 1.0) > 0.005
        if wrong.any():
            row = int(np.argmax(wrong))
            raise TableError(
                f"{table.place(row)}, column {key}: {table[key][row]:g} given, the model's wheel "
                f"has {size:g}; choose rows with --where run=NAME, or correct [gear]"
            )
