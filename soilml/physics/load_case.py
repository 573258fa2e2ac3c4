"""A batch of load cases: a gear on a soil under operating conditions."""

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
    """Everything that the forces on a gear depend on, except its sinkage.

    Inside a computation each parameter is an array of shape () or (batch,).
    """

    gear: Gear
    soil: Soil
    at: Operating
    effects: tuple[Any, ...] = ()  # of `Effect`, whose module needs this one


def rows(load_case: LoadCase, index: Array) -> LoadCase:
    """The rows `index` of a load case; a parameter shared by all rows stays as it is."""
    parameters: dict[str, Any] = dict(values(load_case))
    taken = {path: v[index] for path, v in parameters.items() if getattr(v, "ndim", 0) > 0}
    return with_values(load_case, taken)
