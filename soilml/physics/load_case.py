"""A gear on a soil, driven so: one batch of cases, and how to take rows of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from soilml.arrays import Array
from soilml.parameters import values, with_values
from soilml.physics.gears.base import Gear
from soilml.physics.operating_point import Operating
from soilml.physics.soils.soil import Soil


@dataclass(frozen=True)
class LoadCase:
    """Everything that the forces on a gear depend on, but its sinkage.

    Inside a computation each parameter is an array of shape () or (batch,).
    """

    gear: Gear
    soil: Soil
    at: Operating
    effects: tuple[Any, ...] = ()


def rows(load_case: LoadCase, index: Array) -> LoadCase:
    """The rows `index` of a load_case; a parameter shared by all rows stays as it is."""
    taken = {
        path: value[index]
        for path, value in values(load_case).items()
        if getattr(value, "ndim", 0) > 0
    }
    return with_values(load_case, taken)
