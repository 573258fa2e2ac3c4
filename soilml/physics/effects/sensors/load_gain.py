"""Load gain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real
from soilml.parameters import Parameter
from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import Operating


@final
@dataclass(frozen=True, kw_only=True)
class LoadGain(Effect):
    r"""The load cell reads a share too much: the wheel feels less than is reported.

    .. math:: W' = (1 + e) W

    with W' as reported and W what the soil carries. References: sensor error of first order. A
    zero that is off is `offset` of load-transfer.
    """

    name: ClassVar[str] = "load-gain"
    about: ClassVar[EffectCard] = EffectCard(
        text="the load cell's scale is off",
        source="linear sensor error",
        kind="sensor",
        reference={"gain": 0.03},
        signs={"torque": -1, "sinkage": -1},
        isolate="weighing the wheel on its stand",
        calibration=0.03,
    )
    gain: Annotated[Real, Parameter("1", -0.5, 0.5, "e, share read too much")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        return replace(at, load=at.load / (1.0 + self.gain))
