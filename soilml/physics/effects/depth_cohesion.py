"""Depth-cohesion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress, mobilised_fraction, shear_direction
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class DepthCohesion(SlipLoadScaling):
    r"""The soil holds together better further down, where it is packed more densely.

    .. math:: c(z) = c + c_1 z, \qquad \tau \leftarrow \tau + c_1 z (1 - e^{-|j| / K})

    with z the depth that sets the pressure of a point, and the direction of tau on what is added.
    References: Carrier, Olhoeft and Mendell, Lunar Sourcebook, 1991, chapter 9, cohesion of
    regolith by depth; the straight line is ours. Where n = 1 pressure too is proportional to z,
    and no run distinguishes it from a larger friction angle.
    """

    name: ClassVar[str] = "depth-cohesion"
    about: ClassVar[EffectCard] = EffectCard(
        text="cohesion grows with depth: more shear stress under deeper wheels",
        source="Lunar Sourcebook 1991, ch. 9",
        kind="soil",
        reference={"c1": 2e4},
        signs={"torque": +1, "drawbar_pull": +1, "sinkage": -1},
        isolate="shear tests of soil taken from several depths; a wide range of loads",
    )
    c1: Annotated[Real, Parameter("Pa/m", 0.0, 1e6, "growth of cohesion with depth")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        contact = stress.contact
        xp = namespace(contact.depth)
        mobilised = mobilised_fraction(xp.abs(contact.shear_displacement), load_case.soil)
        cohesion = self.scaled(self.c1, load_case) * contact.depth
        more = shear_direction(contact, load_case.at) * cohesion * mobilised
        return replace(stress, shear=stress.shear + more)
