"""Bearing friction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real
from soilml.parameters import Parameter
from soilml.physics.contact import Force
from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class BearingFriction(Effect):
    r"""The motor turns the bearing too: its torque is more than what the soil asks for.

    .. math:: T' = T + \mu W r

    References: Coulomb friction of a bearing, its coefficient here referred to the radius of the
    wheel and not to that of the shaft. Whether the wheel drives or brakes, it turns forward and the
    friction is on the motor. Not for seals and gears, whose friction the load does not change.
    """

    name: ClassVar[str] = "bearing-friction"
    about: ClassVar[EffectCard] = EffectCard(
        text="friction of the bearing is in the measured torque",
        source="Coulomb friction",
        kind="rig",
        reference={"coefficient": 0.01},
        signs={"torque": +1},
        isolate="turning the wheel, loaded, on a smooth roller or a second bearing",
        calibration=0.005,
    )
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    coefficient: Annotated[Real, Parameter("1", 0.0, 0.3, "mu, referred to r")] = 0.0

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        radius = load_case.gear.radius
        return replace(force, torque=force.torque + self.coefficient * load_case.at.load * radius)
