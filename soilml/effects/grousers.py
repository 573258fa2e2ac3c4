"""Grousers."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.contact import Force
from soilml.effects.base import EffectCard
from soilml.gears.rim import Rim
from soilml.parameters import Parameter
from soilml.scene import Scene


@final
@dataclass(frozen=True, kw_only=True)
class Grousers:
    r"""Lugs shear the soil further out than the rim, and push it like small blades.

    .. math::
        r_s = r + \lambda h, \qquad
        F = N_l \frac{\theta_1}{2\pi} b \left(\tfrac12 \gamma h^2 N_\varphi + q h N_\varphi
        + 2 c h \sqrt{N_\varphi}\right) m, \quad N_\varphi = \tan^2(45° + \varphi / 2)

    The first acts on shear displacement and lever arm. The second, the passive earth pressure on
    the lugs in the soil (q the mean pressure of the load on the contact), acts only where `count`
    is given; m, the share that is mobilised, follows the shear curve under the axle. References:
    shearing radius, Ding et al. 2011; lug thrust, Wong, Theory of Ground Vehicles, chapter 2,
    passive earth pressure (Bekker's grouser). Not for lugs so close that they carry the soil
    between them around, and where both are given part of the thrust is counted twice.
    """

    name: ClassVar[str] = "grousers"
    about: ClassVar[EffectCard] = EffectCard(
        text="lugs shear the soil further out than the rim, and push it like blades",
        source="Ding et al. 2011; Wong, Theory of Ground Vehicles, ch. 2",
        neutral={"height": 0.0, "shearing": 0.75, "count": 0.0},
        reference={"height": 0.01, "count": 16.0},
        signs={"torque": +1, "drawbar_pull": +1},
    )
    height: Annotated[Real, Parameter("m", 0.0, 0.2, "h, height of a lug above the rim")] = 0.0
    shearing: Annotated[Real, Parameter("1", 0.0, 1.0, "lambda, share of h added to r")] = 0.75
    count: Annotated[Real, Parameter("1", 0.0, 200.0, "lugs around the wheel")] = 0.0

    def on_contact(self, rim: Rim, scene: Scene) -> Rim:
        return replace(rim, shear_radius=rim.shear_radius + self.shearing * self.height)

    def on_force(self, force: Force, scene: Scene) -> Force:
        xp = namespace(force.load)
        soil, gear, slip = scene.soil, scene.gear, scene.at.slip
        radius, width = gear.radius, gear.width  # type: ignore[attr-defined]
        passive = xp.tan(math.pi / 4.0 + 0.5 * soil.friction_angle) ** 2
        pressure = scene.at.load / (radius * width * force.entry_angle)
        sheared = radius * xp.abs(force.entry_angle - (1.0 - slip) * xp.sin(force.entry_angle))
        mobilised = -xp.expm1(-sheared / soil.shear_modulus)
        thrust = width * (
            0.5 * soil.unit_weight * self.height**2 * passive
            + pressure * self.height * passive
            + 2.0 * soil.cohesion * self.height * xp.sqrt(passive)
        )
        buried = self.count * force.entry_angle / (2.0 * math.pi)
        total = xp.where(slip < 0, -thrust, thrust) * buried * mobilised
        return replace(
            force,
            drawbar_pull=force.drawbar_pull + total,
            torque=force.torque + total * (radius + 0.5 * self.height),
        )
