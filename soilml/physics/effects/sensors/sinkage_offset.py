"""Sinkage offset."""

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
class SinkageOffset(Effect):
    r"""The sinkage is measured from a level that is not that of the soil.

    .. math:: z' = z + z_0

    References: sensor error of first order. The surface is taken as level; one that was raked
    unevenly is noise, not this.
    """

    name: ClassVar[str] = "sinkage-offset"
    about: ClassVar[EffectCard] = EffectCard(
        text="the sinkage sensor's zero is off",
        source="linear sensor error",
        kind="sensor",
        reference={"offset": 0.001},
        signs={"sinkage": +1},
        isolate="reading the sinkage with the wheel on a plate level with the soil",
        calibration=0.0005,
    )
    offset: Annotated[Real, Parameter("m", -0.1, 0.1, "z0, reading at no sinkage")] = 0.0

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        return replace(force, sinkage=force.sinkage + self.offset)
