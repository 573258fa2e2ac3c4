"""Torque offset."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Force
from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class TorqueOffset(Effect):
    r"""The torque sensor does not read zero when nothing turns it.

    .. math:: T' = T + d T_0

    with d = -1 where the travel speed is given and below zero, else 1: in reverse, a reading that
    is positive along the travel has the sensor's sign turned around, and its zero with it.

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
        isolate="reading the torque with the wheel lifted; the same runs driven the other way",
        calibration=0.05,
    )
    offset: Annotated[Real, Parameter("N m", -100.0, 100.0, "T0, reading at no torque")] = 0.0

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        speed = load_case.at.speed
        xp = namespace(force.torque)
        offset = self.offset + 0.0 * force.torque
        if speed is not None:
            offset = xp.where(speed < 0, -offset, offset)
        return replace(force, torque=force.torque + offset)
