"""Wheel flexibility."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real
from soilml.parameters import Parameter
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.gears.rigid_wheel import RigidWheel, WheelArc, entry_angle
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class WheelFlexibility(SlipLoadScaling):
    r"""A wheel that gives way touches the soil along a longer arc, as a larger rigid wheel would.

    .. math::
        r^* = r (1 + \delta / z), \quad \delta = C W, \quad
        \theta_1 = \arccos(1 - z / r^*)

    The substitute circle has, at small angles, the contact length of the deflected wheel,
    sqrt(2 r (z + delta)); peak and exit keep their share of the entry angle, the torque its lever
    r. References: Bekker, Introduction to Terrain-Vehicle Systems, 1969; Schmid, J. Terramechanics
    32(1), 1995, substitute circle. That the wheel is a linear spring is ours. Not for deflections
    of the order of the radius, nor for a rim that lies flat (`flat-rim`).
    """

    name: ClassVar[str] = "wheel-flexibility"
    about: ClassVar[EffectCard] = EffectCard(
        text="the wheel deflects under its load and touches along a longer arc",
        source="Bekker 1969; Schmid 1995, J. Terramechanics 32(1)",
        kind="wheel",
        reference={"compliance": 2e-5},
        signs={"drawbar_pull": +1, "sinkage": -1},
        isolate="pressing the wheel on a flat plate and measuring how far the axle comes down",
        family="flexible rim",
    )
    law_terms: ClassVar[tuple[str, ...]] = ("by_load",)
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    compliance: Annotated[Real, Parameter("m/N", 0.0, 1e-2, "C, deflection per load")] = 0.0

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        deflection = self.scaled(self.compliance, load_case) * load_case.at.load
        larger = 1.0 + deflection / rim.sinkage
        radius = rim.radius * larger
        entry = entry_angle(rim.sinkage, radius)
        share = entry / rim.entry
        return replace(
            rim,
            entry=entry,
            peak=rim.peak * share,
            exit=rim.exit * share,
            radius=radius,
            shear_radius=rim.shear_radius * larger,
        )
