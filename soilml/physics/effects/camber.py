"""Camber."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.gears.rigid_wheel import WheelArc
from soilml.physics.gears.wheel import Wheel
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import Operating


@final
@dataclass(frozen=True, kw_only=True)
class Camber(Effect):
    r"""The wheel is inclined to the side: its lower edge is deeper in the soil than the upper.

    .. math::
        F = \frac{1}{b} \int_{-b/2}^{b/2} F(z + y \sin\gamma) dy
        \approx \tfrac12 [F(z + d) + F(z - d)], \quad d = \frac{b \sin\gamma}{\sqrt{12}}

    for each force F of an upright wheel, with z the sinkage of the middle of the rim; in the
    wheel's plane the load is W / cos(gamma). References: slices across the width, with the two
    nodes of Gauss and Legendre. What changes is of the order of gamma squared, and large where the
    wheel is wide for its sinkage. The angle is alike to both sides. Side forces, and soil that is
    heaped up beside the wheel, are left out.
    """

    name: ClassVar[str] = "camber"
    about: ClassVar[EffectCard] = EffectCard(
        text="the wheel is inclined to the side: one edge digs in",
        source="geometry; slices across the width",
        kind="rig",
        reference={"angle": 0.15},
        signs={"sinkage": -1},
        isolate="a spirit level on the side of the wheel, under load",
        calibration=0.03,
    )
    load_rises: ClassVar[bool] = True
    more_points: ClassVar[bool] = True
    gear_types: ClassVar[tuple[type, ...]] = (Wheel,)
    angle: Annotated[Real, Parameter("rad", 0.0, 0.5, "gamma, of the wheel's plane")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        xp = namespace(at.load)
        return replace(at, load=at.load / xp.cos(self.angle + 0.0 * at.load))

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        xp = namespace(rim.entry)
        tilt = rim.width / math.sqrt(12.0) * xp.sin(self.angle + 0.0 * rim.entry)
        return replace(rim, tilt=tilt) if bool(xp.any(tilt > 0.0)) else rim
