"""Exit angle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

import numpy as np

from soilml.arrays import Real, namespace, to_numpy
from soilml.errors import InputError
from soilml.parameters import Parameter
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.gears.rigid_wheel import RigidWheel, WheelArc, entry_angle
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class ExitAngle(SlipLoadScaling):
    r"""The soil springs back, or clings, and touches the rim behind the axle too.

    .. math:: \theta_2 = -\arccos(1 - \kappa z / r) + b_0 \theta_1

    Give one of the two forms; both are refused. The angle is about sqrt(kappa) theta_1: a tenth of
    kappa is a third of the angle. Behind the axle the shear of a driving wheel pulls it down. The
    wider contact mostly lifts the wheel, but in some 4 % of the driving rows of the box of
    the tests (kappa 0.15) it sinks deeper. Under a braking wheel whose contact is nearly
    symmetric (kappa = 1, b0 = -1) the law "slip-sign" can yield power instead of spending it: do
    not brake with such values by that law. References: kappa, Ishigami, Miwa, Nagatani and Yoshida,
    J. Field Robotics 24(3), 2007; b0, Ding et al. 2011. For wheels.
    """

    name: ClassVar[str] = "exit-angle"
    about: ClassVar[EffectCard] = EffectCard(
        text="the rim touches the soil behind the axle too: theta_2 below zero",
        source="Ishigami et al. 2007, J. Field Robotics 24(3); Ding et al. 2011",
        kind="soil",
        reference={"kappa": 0.15},
        signs={"drawbar_pull": +1, "sinkage": -1},
        isolate="runs near zero slip; the wheel weighed on its stand",
    )
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    kappa: Annotated[Real, Parameter("1", 0.0, 1.0, "height at exit / sinkage")] = 0.0
    b0: Annotated[Real, Parameter("1", -1.0, 0.0, "theta_2 / theta_1")] = 0.0

    def __post_init__(self) -> None:
        if np.any((to_numpy(self.kappa) != 0.0) & (to_numpy(self.b0) != 0.0)):
            raise InputError("exit-angle takes kappa or b0, and both are given: leave one at 0")

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        xp = namespace(rim.entry)
        kappa = xp.minimum(
            self.scaled(self.kappa, load_case) + 0.0 * rim.entry, xp.ones_like(rim.entry)
        )
        behind = -entry_angle(kappa * rim.sinkage, rim.radius)
        return replace(rim, exit=rim.exit + behind + self.b0 * rim.entry)
