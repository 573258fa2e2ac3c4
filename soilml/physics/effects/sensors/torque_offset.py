"""Torque offset."""

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
class TorqueOffset(Effect):
    r"""The torque sensor does not read zero when nothing turns it.

    .. math:: T' = T + T_0

    References: sensor error of first order. Constant over a
    campaign; a zero that drifts with temperature is not of this form.
    """

    name: ClassVar[str] = "torque-offset"
    about: ClassVar[EffectCard] = EffectCard(
        text="the torque sensor's zero is off",
        source="linear sensor error",
        kind="sensor",
        reference={"offset": 0.1},
        signs={"torque": +1},
        isolate="reading the torque with the wheel lifted off the ground",
        calibration=0.05,
    )
    offset: Annotated[Real, Parameter("N m", -100.0, 100.0, "T0, reading at no torque")] = 0.0

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        return replace(force, torque=force.torque + self.offset)
