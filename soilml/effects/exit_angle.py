"""Exit angle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.effects.base import EffectCard
from soilml.effects.shaped import Shaped
from soilml.gears.rim import Rim
from soilml.parameters import Parameter
from soilml.scene import Scene


@final
@dataclass(frozen=True, kw_only=True)
class ExitAngle(Shaped):
    r"""The soil springs back, or clings, and touches the rim behind the axle too.

    .. math:: \theta_2 = -\arccos(1 - \kappa z / r) + b_0 \theta_1

    Give one of the two forms. References: kappa, Ishigami, Miwa, Nagatani and Yoshida, J. Field
    Robotics 24(3), 2007; b0, Ding et al. 2011. For wheels.
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
    kappa: Annotated[Real, Parameter("1", 0.0, 1.0, "height at exit / sinkage")] = 0.0
    b0: Annotated[Real, Parameter("1", -1.0, 0.0, "theta_2 / theta_1")] = 0.0

    def on_contact(self, rim: Rim, scene: Scene) -> Rim:
        xp = namespace(rim.entry)
        kappa = xp.minimum(self.grown(self.kappa, scene) + 0.0 * rim.entry, xp.ones_like(rim.entry))
        behind = -2.0 * xp.asin(xp.sqrt(kappa * rim.sinkage / (2.0 * rim.radius)))
        return replace(rim, exit=rim.exit + behind + self.b0 * rim.entry)
