"""A batch of load cases: a gear on a soil under operating conditions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from soilml.arrays import Array, namespace
from soilml.parameters import mapped
from soilml.physics.gears.base import Gear
from soilml.physics.operating_point import Operating
from soilml.physics.soils.soil import Soil


@dataclass(frozen=True)
class LoadCase:
    """Everything that the forces on a gear depend on, except its sinkage.

    Inside a computation each parameter is an array of shape () or (batch,).
    """

    gear: Gear
    soil: Soil
    at: Operating
    effects: tuple[Any, ...] = ()  # of `Effect`, whose module needs this one


def rows(load_case: LoadCase, index: Array) -> LoadCase:
    """The rows `index` of a load case; a parameter shared by all rows stays as it is."""
    return mapped(load_case, lambda v: v[index] if getattr(v, "ndim", 0) > 0 else v)


def single_precision(load_case: LoadCase) -> LoadCase:
    """The load case in float32, for estimates that are checked in float64."""
    xp = namespace(load_case.at.load)
    return mapped(load_case, lambda v: xp.astype(v, xp.float32) if hasattr(v, "dtype") else v)
