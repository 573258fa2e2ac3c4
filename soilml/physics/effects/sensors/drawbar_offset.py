"""Drawbar offset."""

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
class DrawbarOffset(Effect):
    r"""The drawbar sensor does not read zero when nothing pulls.

    .. math:: DP' = DP + F_0

    References: sensor error of first order; friction of the carriage, which changes its sign with
    the direction of travel, is not of this form.
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
        return replace(force, drawbar_pull=force.drawbar_pull + self.offset)
