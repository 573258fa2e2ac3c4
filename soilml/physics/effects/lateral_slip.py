"""Lateral slip."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress, travel_ratio
from soilml.physics.effects.base import EffectCard, SlipLoadScaling, covariate
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class LateralSlip(SlipLoadScaling):
    r"""A wheel that slides sideways too shears the soil along its slip velocity.

    .. math::
        j_y = a (1 - s) \tan\beta \; r (\theta_1 - \theta), \quad j = \sqrt{j_x^2 + j_y^2}, \quad
        \tau_x = (c + \sigma \tan\varphi) (1 - e^{-j / K}) \frac{|j_x|}{j}

    with the direction of the gear's shear stress on tau_x. While a wheel brakes, its travel ratio
    1 / (1 + s) takes the place of 1 - s, unless its law is "slip-sign". References: Yoshida and
    Ishigami, IROS 2004, eqs. for the lateral shear displacement; Ishigami et al., J. Field Robotics
    24(3), 2007. They let each direction reach its full strength by itself (tau_x from j_x alone,
    tau_y from j_y alone); here both share one strength, and `share` 0 is the former. A `share`
    above 1 stands for soil that the flank of the wheel pushes along. The side force itself is no
    output.
    """

    name: ClassVar[str] = "lateral-slip"
    about: ClassVar[EffectCard] = EffectCard(
        text="sliding sideways uses up shear strength that would drive",
        source="Yoshida and Ishigami 2004, IROS; Ishigami et al. 2007",
        kind="soil",
        reference={"share": 1.0},
        signs={"torque": -1, "drawbar_pull": -1},
        isolate="the same runs with the wheel held straight, and at several slip angles",
        needs=("slip_angle",),
    )
    share: Annotated[Real, Parameter("1", 0.0, 5.0, "times the sideways displacement")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        contact, modulus = stress.contact, load_case.soil.shear_modulus
        beta = covariate(load_case, "slip_angle", self.name)
        xp = namespace(contact.shear_displacement)
        travelled = travel_ratio(contact, load_case.at)
        aside = self.scaled(self.share, load_case) * travelled * xp.tan(beta)
        aside = aside * contact.surface_travel
        ahead = xp.maximum(xp.abs(contact.shear_displacement), xp.full_like(aside, 1e-30))
        both = xp.where(aside == 0, ahead, xp.hypot(ahead, aside))
        # forward stress of the whole displacement over that of its forward part alone
        factor = (xp.expm1(-both / modulus) / both) / (xp.expm1(-ahead / modulus) / ahead)
        return replace(stress, shear=stress.shear * factor)
