"""Clogging."""

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
class Clogging(SlipLoadScaling):
    r"""Soil clings to the rim, or fills the room between its lugs: the wheel is a larger one.

    .. math::
        r \leftarrow r + h, \quad \theta_1 = \arccos(1 - z / (r + h)), \quad
        \frac{v}{(r + h) \omega} = (1 - s) \frac{r}{r + h}

    in the pressure, the shear displacement and the lever arm of the torque, with s the slip of the
    clean rim, as a rig reckons it, and z the sinkage of the layer. References: Ding et al., J.
    Terramechanics 48(1), 2011, the radius r + lambda h of shearing around lugs, here with lambda =
    1 and in all of the contact; definition of slip. That the layer turns with the wheel and is as
    strong as the soil is ours. Lugs on a wheel whose slip is that of the rim look much the same:
    `grousers` with rim_slip = 1. Lugs of which `grousers` has the shear already count once more
    beside it: give it the part of h that clogs beyond theirs. Not for soil that falls off again
    within a turn.
    """

    name: ClassVar[str] = "clogging"
    about: ClassVar[EffectCard] = EffectCard(
        text="a larger wheel: soil on the rim or between lugs, or lugs, with the slip of the rim",
        source="Ding et al. 2011, J. Terramechanics 48(1), radius of shearing",
        kind="wheel",
        reference={"layer": 0.003},
        signs={"torque": +1, "drawbar_pull": +1},
        isolate="measure the lugs; the same runs with the wheel brushed clean before each",
    )
    load_rises: ClassVar[bool] = True
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    layer: Annotated[Real, Parameter("m", 0.0, 0.1, "h, thickness of the layer of soil")] = 0.0

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        layer = self.scaled(self.layer, load_case)
        radius, shear_radius = rim.radius + layer, rim.shear_radius + layer
        entry = entry_angle(rim.sinkage, radius)
        share = entry / rim.entry
        return replace(
            rim,
            entry=entry,
            peak=rim.peak * share,
            exit=rim.exit * share,
            radius=radius,
            shear_radius=shear_radius,
            lever=rim.lever + layer,
            travel=rim.travel * (rim.shear_radius / shear_radius),
        )
