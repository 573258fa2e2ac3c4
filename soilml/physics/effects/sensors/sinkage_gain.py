"""Sinkage gain."""

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
class SinkageGain(Effect):
    r"""The sinkage sensor reads a share too much, or too little.

    .. math:: z' = (1 + e) z

    References: sensor error of first order, such as an arm whose length is not what was written
    down; for angles so small that its height goes straight with its angle.
    """

    name: ClassVar[str] = "sinkage-gain"
    about: ClassVar[EffectCard] = EffectCard(
        text="the sinkage sensor's scale is off",
        source="linear sensor error",
        kind="sensor",
        reference={"gain": 0.03},
        signs={"sinkage": +1},
        isolate="reading the sinkage on blocks of known height",
        calibration=0.03,
    )
    gain: Annotated[Real, Parameter("1", -0.5, 0.5, "e, share read too much")] = 0.0

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        return replace(force, sinkage=force.sinkage * (1.0 + self.gain))
