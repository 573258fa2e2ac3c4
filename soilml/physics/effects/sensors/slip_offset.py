"""Slip offset."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import MOST_SLIP, Operating


@final
@dataclass(frozen=True, kw_only=True)
class SlipOffset(Effect):
    r"""The reported slip is off by the same amount in all rows.

    .. math:: s = s' - s_0

    with s' as reported. An estimate of slip from images or from motor current can have such an
    error; a wrong travel speed or wheel radius has the form of `slip-scale` instead, which equals
    an offset of -e at small slip and vanishes towards full slip. References: sensor error of first
    order.
    """

    name: ClassVar[str] = "slip-offset"
    about: ClassVar[EffectCard] = EffectCard(
        text="the reported slip is off by a constant",
        source="linear sensor error",
        kind="sensor",
        reference={"offset": 0.015},
        signs={"torque": -1, "drawbar_pull": -1},
        isolate="rolling the wheel unpowered on hard ground: its slip there is nil",
        calibration=0.01,
    )
    offset: Annotated[Real, Parameter("1", -0.2, 0.2, "s0, reported slip at no slip")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        xp = namespace(at.slip)
        true = at.slip - self.offset
        most = xp.full_like(true, MOST_SLIP)
        return replace(at, slip=xp.minimum(xp.maximum(true, -most), most))
