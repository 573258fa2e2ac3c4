"""Flat rim."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.gears.rigid_wheel import WheelArc, entry_angle
from soilml.physics.gears.wheel import Wheel
from soilml.physics.load_case import LoadCase

MOST_DEFLECTION = 0.3  # Largest deflection, as a fraction of the radius


@final
@dataclass(frozen=True, kw_only=True)
class FlatRim(SlipLoadScaling):
    r"""A rim that gives way lies flat on the soil along a chord, before and behind the axle.

    .. math::
        \delta = C W, \quad \theta_c = \arccos(1 - \delta / r), \quad
        \theta_1 = \arccos(1 - (z + \delta) / r), \quad \theta_2 \leftarrow \theta_2 - \theta_c

    z is the sinkage of the chord. Between -theta_c and theta_c the rim is level: it pushes no soil
    ahead, and its normal stress has a lever arm about the axle. References: Bekker, Introduction to
    Terrain-Vehicle Systems, 1969, and Wong, Theory of Ground Vehicles, chapter 2, the flexible
    wheel as a level chord behind an arc of its own radius. Theirs is pressed uniformly; that the
    pressure falls to the rear end as Wong and Reece have it, so that C = 0 is the rigid wheel, and
    the linear spring are ours. `wheel-flexibility` is the other form, a larger circle. Not for
    deflections above 0.3 of the radius.
    """

    name: ClassVar[str] = "flat-rim"
    about: ClassVar[EffectCard] = EffectCard(
        text="the rim gives way and lies flat on the soil along a chord",
        source="Bekker 1969; Wong, Theory of Ground Vehicles, ch. 2",
        kind="wheel",
        reference={"compliance": 2e-5},
        signs={"drawbar_pull": +1, "sinkage": -1},
        isolate="pressing the wheel on a flat plate and measuring how far the axle comes down",
        family="flexible rim",
    )
    law_terms: ClassVar[tuple[str, ...]] = ("by_load",)
    load_rises: ClassVar[bool] = True
    more_points: ClassVar[bool] = True
    gear_types: ClassVar[tuple[type, ...]] = (Wheel,)
    compliance: Annotated[Real, Parameter("m/N", 0.0, 1e-2, "C, deflection per load")] = 0.0

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        xp = namespace(rim.entry)
        deflection = self.scaled(self.compliance, load_case) * load_case.at.load
        if not bool(xp.any(deflection > 0.0)):
            return rim
        most = MOST_DEFLECTION * rim.radius + 0.0 * deflection
        deflection = xp.minimum(deflection, most) + 0.0 * rim.entry
        entry = entry_angle(rim.sinkage + deflection, rim.radius)
        chord = entry_angle(deflection, rim.radius)
        return replace(
            rim,
            entry=entry,
            peak=rim.peak * (entry / rim.entry),
            exit=rim.exit - chord,
            chord=chord,
        )
