"""Curved envelope."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress, with_strength
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.load_case import LoadCase

#: Normal stress (Pa) at which the strength is that of the straight envelope, and the smallest.
AT_STRESS, SMALLEST_STRESS = 1e4, 1e-20


@final
@dataclass(frozen=True, kw_only=True)
class CurvedEnvelope(SlipLoadScaling):
    r"""The envelope of strength is curved: friction falls with the normal stress.

    .. math::
        \tau_{max} = c + \sigma \tan\varphi \left(\frac{\sigma}{\sigma_0}\right)^{-a}, \quad
        \sigma_0 = 10 kPa

    so that phi is the secant friction angle at 10 kPa, and a = 0 the straight envelope of Mohr and
    Coulomb. References: Charles and Watts, Geotechnique 30(4), 1980, tau = A sigma^b with b = 1 - a
    of 0.7 to 0.9 for rockfill; Atkinson, The Mechanics of Soils and Foundations, chapter on peak
    states, the same for the peak strength of soils; Baker, J. Geotech. Geoenviron. Eng. 130(5),
    2004, curved envelopes of many soils, above all at small normal stress; Bolton, Geotechnique
    36(1), 1986, on why: dense soil dilates less under pressure. Cohesion beside the power is ours.
    Where all loads press alike it is a change of c and phi.
    """

    name: ClassVar[str] = "curved-envelope"
    about: ClassVar[EffectCard] = EffectCard(
        text="the strength envelope is curved: friction falls with the normal stress",
        source="Charles and Watts 1980, Geotechnique 30(4); Baker 2004",
        kind="soil",
        reference={"exponent": 0.2},
        signs={},
        isolate="shear tests of the soil under a wide range of pressures; a wide range of loads",
        family="strength envelope",
    )
    law_terms: ClassVar[tuple[str, ...]] = ()
    load_rises: ClassVar[bool] = True
    exponent: Annotated[Real, Parameter("1", 0.0, 0.8, "a, loss of power of the stress")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        xp, soil, normal = namespace(stress.normal), load_case.soil, stress.normal
        relative = xp.maximum(normal, xp.full_like(normal, SMALLEST_STRESS)) / AT_STRESS
        friction = normal * xp.tan(soil.friction_angle)
        curved = friction * xp.exp(-self.scaled(self.exponent, load_case) * xp.log(relative))
        return with_strength(
            stress, before=soil.cohesion + friction, strength=soil.cohesion + curved
        )
