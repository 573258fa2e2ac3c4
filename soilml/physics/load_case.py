"""A batch of load cases: a gear on a soil under operating conditions, and rows of it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

from soilml.arrays import Array, namespace
from soilml.parameters import mapped
from soilml.physics.contact import Force, Resolution
from soilml.physics.gears.base import Gear
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil


@dataclass(frozen=True)
class LoadCase:
    """Everything that the forces on a gear depend on, except its sinkage.

    Inside a computation each parameter is an array of shape () or (batch,).
    """

    gear: Gear
    soil: Soil
    at: Operating
    effects: tuple[Any, ...] = ()  # of `Effect`, whose module needs this one
    resolution: Resolution = Resolution.FULL


def rows(load_case: LoadCase, index: Array) -> LoadCase:
    """The rows `index` of a load case; a parameter shared by all rows stays as it is."""
    return mapped(load_case, lambda v: v[index] if getattr(v, "ndim", 0) > 0 else v)


def merge_rows(force: Force, keep: Array, others: Force) -> Force:
    """`force` where `keep`, and the rows of `others`, in order, elsewhere."""
    xp = namespace(force.load)
    position = merged_position(keep)
    merged = {}
    for field in fields(Force):
        both = xp.concat([getattr(force, field.name), getattr(others, field.name)], axis=0)
        merged[field.name] = xp.take(both, position, axis=0)
    return Force(**merged)


def merged_position(keep: Array) -> Array:
    """Where each merged row is, in all rows followed by the rows that are not kept."""
    xp = namespace(keep)
    size = keep.shape[0]
    return xp.where(
        keep,
        xp.arange(size, device=keep.device),
        size - 1 + xp.cumulative_sum(xp.astype(~keep, xp.int64)),
    )


def coarse(load_case: LoadCase) -> LoadCase:
    """The load case at coarse resolution in float32, for estimates that are checked."""
    xp = namespace(load_case.at.load)
    single = mapped(load_case, lambda v: xp.astype(v, xp.float32) if hasattr(v, "dtype") else v)
    return replace(single, resolution=Resolution.COARSE)
