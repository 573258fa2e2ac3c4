"""Stress shift."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real
from soilml.parameters import Parameter
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.gears.rigid_wheel import RigidWheel, WheelArc
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class StressShift(SlipLoadScaling):
    r"""Under a small wheel the stressed arc is shorter than the contact and lies at its front.

    .. math::
        \theta \leftarrow \theta + a (\theta_1 - \theta), \quad
        \theta \in \{\theta_m, \theta_2\}

    so that the arc keeps the share 1 - a of its length. References: Nagatani, Ikeda, Sato and
    Yoshida, IROS 2009, section IV: of 70 degrees of contact 30 carry stress, a = 0.57. The stress
    there also moves on with slip (`by_slip`); that all angles move by one rule is our reading.
    Pressure is still Bekker's at the depth of each point, so that a shorter arc further up must
    sink to carry its load. Not for wheels above half a metre.
    """

    name: ClassVar[str] = "stress-shift"
    about: ClassVar[EffectCard] = EffectCard(
        text="stresses sit at the front of the contact: small wheels",
        source="Nagatani et al. 2009, IROS, sec. IV",
        kind="soil",
        reference={"shift": 0.2},
        signs={"drawbar_pull": -1, "sinkage": +1},
        isolate="force sensors in the rim; the same soil under a larger wheel",
    )
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    shift: Annotated[Real, Parameter("1", 0.0, 0.9, "share of the way to the entry angle")] = 0.0

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        shift = self.scaled(self.shift, load_case)
        return replace(
            rim,
            peak=rim.peak + shift * (rim.entry - rim.peak),
            exit=rim.exit + shift * (rim.entry - rim.exit),
        )
