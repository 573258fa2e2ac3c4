"""The contact of a wheel that is inclined to the side, as two slices at different depths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from soilml.arrays import Array, namespace
from soilml.physics.contact import Contact
from soilml.physics.gears.rigid_wheel import WheelArc, entry_angle

LIFTED = 1e-9  # Sinkage of a slice that is out of the soil, as a fraction of the wheel's
#: Fields of `Contact` with a value at each point.
AT_POINTS = (
    *("depth", "shear_displacement", "surface_travel"),
    *("area", "horizontal_area", "frontal_area"),
)
_ANGLES = ("entry", "peak", "exit")


def sliced_contact(rim: WheelArc, contact_of: Callable[[WheelArc], Contact]) -> Contact:
    """The points of two slices of half the width, `rim.tilt` (m) deeper and less deep than it.

    `contact_of` gives the contact of one arc. Angles keep their share of the entry angle.
    """
    xp = namespace(rim.entry)
    lifted = LIFTED * rim.sinkage
    depths = (rim.sinkage + rim.tilt, xp.maximum(rim.sinkage - rim.tilt, lifted))
    slices = [_at_depth(rim, depth) for depth in depths]
    parts = [contact_of(own) for own in slices]
    points = [part.depth.shape[0] for part in parts]

    def joined(values: list[Any]) -> Array:
        both = zip(values, points, strict=True)
        return xp.concat([xp.broadcast_to(v, (n, v.shape[-1])) for v, n in both], axis=0)

    angles = {name: joined([getattr(own, name) for own in slices]) for name in _ANGLES}
    fields = {name: joined([getattr(part, name) for part in parts]) for name in AT_POINTS}
    for name in ("area", "horizontal_area", "frontal_area"):
        fields[name] = 0.5 * fields[name]
    for name in ("shear_lever_arm", "normal_lever_arm", "shear_direction"):
        if getattr(getattr(parts[0], name), "ndim", 0) > 1:
            fields[name] = joined([getattr(part, name) for part in parts])
    return replace(parts[0], **fields, repeats=1, geometry=replace(rim, **angles))


def _at_depth(rim: WheelArc, depth: Array) -> WheelArc:
    share = entry_angle(depth, rim.radius) / entry_angle(rim.sinkage, rim.radius)
    angles = {name: getattr(rim, name) * share for name in _ANGLES}
    return replace(rim, **angles, sinkage=depth, tilt=None)
