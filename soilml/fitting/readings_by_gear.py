"""The readings of each of several gears, with the case and the coordinates that act on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.operating_points import rows_by_gear
from soilml.fitting.readings import Readings

if TYPE_CHECKING:
    from soilml.fitting.coordinates import Coordinate

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class GearReadings:
    """The readings of one gear, with its case and the coordinates that act on it.

    `kept` (p,) are the positions of these coordinates among all, `rows` (n,) those of the rows and
    `selected` (m,) those of the readings.
    """

    case: Case
    coordinates: list[Coordinate]
    kept: Integers
    readings: Readings
    rows: Integers
    selected: Integers


def readings_by_gear(
    case: Case, coordinates: Sequence[Coordinate], readings: Readings
) -> list[GearReadings]:
    """The readings of each gear of a case with several; none where there is one gear.

    A gear without readings is left out.
    """
    parts: list[GearReadings] = []
    if not case.gears:
        return parts
    for gear in rows_by_gear(case, readings.at):
        selected, own = readings.of_rows(gear.rows, gear.at)
        if not selected.any():
            continue
        kept = [i for i, c in enumerate(coordinates) if c.path in gear.paths]
        parts.append(
            GearReadings(
                gear.case,
                [_at_path(coordinates[i], gear.paths[coordinates[i].path]) for i in kept],
                np.asarray(kept, dtype=np.int64),
                own,
                gear.rows,
                np.flatnonzero(selected),
            )
        )
    return parts


def _at_path(coordinate: Coordinate, path: str) -> Coordinate:
    """The coordinate of an effect by the name that the effect has in the case of one gear."""
    if coordinate.path == path:
        return coordinate
    effect: dict[str, Any] = {"effect": path.partition(".")[0]}
    return replace(coordinate, **effect)
