"""Drawbar gain."""

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
class DrawbarGain(Effect):
    r"""The drawbar sensor reads a share too much, or too little.

    .. math:: DP' = (1 + e) DP

    References: sensor error of first order. It says nothing of a sensor that also feels the load.
    """

    name: ClassVar[str] = "drawbar-gain"
    about: ClassVar[EffectCard] = EffectCard(
        text="the drawbar sensor's scale is off",
        source="linear sensor error",
        kind="sensor",
        reference={"gain": 0.03},
        signs={},
        isolate="a dead weight on the drawbar over a pulley",
        calibration=0.03,
    )
    gain: Annotated[Real, Parameter("1", -0.5, 0.5, "e, share read too much")] = 0.0

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        return replace(force, drawbar_pull=force.drawbar_pull * (1.0 + self.gain))
