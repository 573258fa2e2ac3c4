"""Drawbar offset."""

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
class DrawbarOffset(Effect):
    r"""The drawbar sensor does not read zero when nothing pulls.

    .. math:: DP' = DP + d F_0

    with d = -1 where the travel speed is given and below zero, else 1: in reverse, a reading that
    is positive along the travel has the sensor's sign turned around, and its zero with it.

    References: sensor error of first order; friction of the carriage, which opposes the travel in
    both directions, is not of this form.
    """

    name: ClassVar[str] = "drawbar-offset"
    about: ClassVar[EffectCard] = EffectCard(
        text="the drawbar sensor's zero is off",
        source="linear sensor error",
        kind="sensor",
        reference={"offset": 0.5},
        signs={"drawbar_pull": +1},
        isolate="reading the drawbar with the wheel lifted; the same runs driven the other way",
        calibration=0.5,
    )
    offset: Annotated[Real, Parameter("N", -200.0, 200.0, "F0, reading at no pull")] = 0.0

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        speed = load_case.at.speed
        xp = namespace(force.drawbar_pull)
        offset = self.offset + 0.0 * force.drawbar_pull
        if speed is not None:
            offset = xp.where(speed < 0, -offset, offset)
        return replace(force, drawbar_pull=force.drawbar_pull + offset)
