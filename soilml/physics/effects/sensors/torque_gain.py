"""Torque gain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real
from soilml.parameters import Parameter
from soilml.physics.contact import Force
from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class TorqueGain(Effect):
    r"""The torque sensor reads a share too much, or too little.

    .. math:: T' = (1 + e) T

    References: sensor error of first order. A torque computed from motor current with a wrong
    torque constant is of this form too; friction of the gears is not.
    """

    name: ClassVar[str] = "torque-gain"
    about: ClassVar[EffectCard] = EffectCard(
        text="the torque sensor's scale is off",
        source="linear sensor error",
        kind="sensor",
        reference={"gain": 0.03},
        signs={"torque": +1},
        isolate="a dead weight on a lever of known length",
        calibration=0.03,
    )
    gain: Annotated[Real, Parameter("1", -0.5, 0.5, "e, share read too much")] = 0.0

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        return replace(force, torque=force.torque * (1.0 + self.gain))
