"""Bulldozing."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Force
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class Bulldozing(SlipLoadScaling):
    r"""The wheel pushes a wall of soil before it; drawbar pull alone pays for it.

    .. math::
        R = b (0.67 c z K_c + \tfrac12 z^2 \gamma K_\gamma), \quad
        K_c = (N_c - \tan\varphi') \cos^2\varphi', \quad
        K_\gamma = \left(\frac{2 N_\gamma}{\tan\varphi'} + 1\right) \cos^2\varphi', \quad
        \tan\varphi' = \tfrac23 \tan\varphi

    with the bearing capacity factors N_q and N_c of Prandtl and Reissner and N_gamma of Vesic.
    References: Bekker 1969 and Wong, Theory of Ground Vehicles, chapter 2, eqs. for bulldozing
    resistance in local shear failure. `share` scales it: 1 is the formula. It pulls back whichever
    way the wheel slips.
    """

    name: ClassVar[str] = "bulldozing"
    about: ClassVar[EffectCard] = EffectCard(
        text="the wheel pushes a wall of soil before it: less drawbar pull",
        source="Bekker 1969; Wong, Theory of Ground Vehicles, ch. 2",
        kind="soil",
        reference={"share": 1.0},
        signs={"drawbar_pull": -1},
        isolate="the same runs driven the other way, which turns a slope around; heavier loads",
    )
    share: Annotated[Real, Parameter("1", 0.0, 5.0, "times the formula's resistance")] = 0.0

    def on_force(self, force: Force, load_case: LoadCase) -> Force:
        xp = namespace(force.load)
        soil = load_case.soil
        tan = 2.0 / 3.0 * xp.tan(soil.friction_angle)
        tan = xp.maximum(tan, xp.full_like(tan, 1e-6))  # the factors have limits at phi = 0
        cos2 = 1.0 / (1.0 + tan * tan)
        angle = xp.atan(tan)
        n_q = xp.exp(math.pi * tan) * xp.tan(math.pi / 4.0 + 0.5 * angle) ** 2
        k_c = ((n_q - 1.0) / tan - tan) * cos2
        k_gamma = (4.0 * (n_q + 1.0) + 1.0) * cos2  # N_gamma / tan = 2 (N_q + 1), Vesic
        width = load_case.gear.width
        z = force.sinkage
        resistance = width * (
            0.67 * soil.cohesion * z * k_c + 0.5 * z * z * soil.unit_weight * k_gamma
        )
        share = self.scaled(self.share, load_case)
        return replace(force, drawbar_pull=force.drawbar_pull - share * resistance)
