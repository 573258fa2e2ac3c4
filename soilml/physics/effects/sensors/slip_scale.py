"""Slip scale."""

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
class SlipScale(Effect):
    r"""Travel speed, or the wheel's radius, is known wrongly, and slip with it.

    .. math::
        1 - s' = (1 - s) (1 + e) \text{ driving}, \quad
        1 + s = (1 + s') (1 + e) \text{ braking}

    with s' as reported: in both the reported v / (r omega) is 1 + e times the true one, by the two
    definitions of slip; a row may pass from one to the other. References: definitions of slip,
    Wong, Theory of Ground Vehicles, chapter 2; Nagatani et al., online climbing ability, where 1.5
    per cent of speed is a large part of a small slip.
    """

    name: ClassVar[str] = "slip-scale"
    about: ClassVar[EffectCard] = EffectCard(
        text="travel speed or wheel radius is off, and slip with it",
        source="definition of slip",
        kind="sensor",
        reference={"error": 0.015},
        signs={"torque": +1, "drawbar_pull": +1},
        isolate="rolling the wheel unpowered on hard ground: its slip there is nil",
        calibration=0.01,
    )
    error: Annotated[Real, Parameter("1", -0.2, 0.2, "e, of v / (r omega) as reported")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        slip = at.slip
        xp = namespace(slip)
        driving = slip + (1.0 - slip) * (self.error / (1.0 + self.error))
        true = xp.where(slip < 0, slip + (1.0 + slip) * self.error, driving)
        # where the sign of slip changes, the other definition of slip applies
        true = xp.where((slip < 0) == (true < 0), true, true / (1.0 + xp.abs(true)))
        most = xp.full_like(true, MOST_SLIP)
        return replace(at, slip=xp.minimum(xp.maximum(true, -most), most))
