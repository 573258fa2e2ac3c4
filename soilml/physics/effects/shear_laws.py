"""Laws of shear stress against displacement and against normal stress."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, ClassVar

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress, with_strength
from soilml.physics.effects.base import SlipLoadScaling, effect
from soilml.physics.load_case import LoadCase


@effect(
    "shear-softening",
    source="Wong, Theory of Ground Vehicles, ch. 2; Wang et al. 2018, eq. 6",
    kind="soil",
    reference={"share": 0.5},
    isolate="a shear-ring test of the soil; runs from the smallest to the largest slip",
    family="shear law",
)
class ShearSoftening(SlipLoadScaling):
    r"""Shear stress peaks and falls to a residual: dense sand, crusts.

    .. math::
        m_W = K_r \left\{1 + \left[\frac{1}{K_r (1 - 1/e)} - 1\right] e^{1 - j / K_w}\right\}
        (1 - e^{-j / K_w}), \qquad
        \tau \leftarrow \tau \left[1 + a \left(\frac{m_W}{1 - e^{-j / K}} - 1\right)\right]

    with j the size of the shear displacement: a = 1 is Wong's curve, which is 1 at j = K_w, a = 0
    that of Janosi and Hanamoto. References: Wong, Theory of Ground Vehicles, chapter 2, shear
    curve with a hump; printed in Wang et al. 2018, eq. 6. Blending the two is ours. With K free it
    changes hardly anything that a wheel can feel.
    """

    share: Annotated[Real, Parameter("1", 0.0, 1.0, "share of Wong's curve")] = 0.0
    residual: Annotated[Real, Parameter("1", 0.05, 1.0, "K_r, residual / peak stress")] = 0.7
    peak: Annotated[Real, Parameter("1", 0.2, 10.0, "K_w / K, where the peak is")] = 1.5

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        sheared = stress.contact.shear_displacement
        xp = namespace(sheared)
        # the ratio of the curves has a limit where neither has moved
        moved = xp.maximum(xp.abs(sheared), xp.full_like(sheared, 1e-30))
        modulus = load_case.soil.shear_modulus
        at_peak = moved / (self.peak * modulus)
        hump = (1.0 / (self.residual * (1.0 - math.exp(-1.0))) - 1.0) * xp.exp(1.0 - at_peak)
        wong = self.residual * (1.0 + hump) * -xp.expm1(-at_peak)
        ratio = wong / -xp.expm1(-moved / modulus)
        factor = 1.0 + self.scaled(self.share, load_case) * (ratio - 1.0)
        return replace(stress, shear=stress.shear * factor)


@effect(
    "hyperbolic-shear",
    source="Kondner 1963; Duncan and Chang 1970, ASCE 96(SM5)",
    kind="soil",
    reference={"share": 0.5},
    signs={"torque": -1, "drawbar_pull": -1},
    isolate="a shear-ring test of the soil; runs from the smallest to the largest slip",
    family="shear law",
)
class HyperbolicShear(SlipLoadScaling):
    r"""Shear stress rises along a hyperbola and mobilises its full strength late.

    .. math::
        m_h = \frac{j}{K + j}, \qquad
        \tau \leftarrow \tau \left[1 + a \left(\frac{m_h}{1 - e^{-j / K}} - 1\right)\right]

    with j the size of the shear displacement: a = 1 is the hyperbola, a = 0 the exponential curve
    of Janosi and Hanamoto, of the same initial slope. Half the strength is mobilised at K, and 0.9
    of it at 9 K instead of 2.3 K. References: Kondner, J. Soil Mech. Found. Div. ASCE 89(SM1),
    1963, stress by strain over (a + b strain); Duncan and Chang, J. Soil Mech. Found. Div. ASCE
    96(SM5), 1970, the same with a failure ratio, here 1. The strength in the place of Kondner's
    asymptote, and blending the two curves, are ours. With K free, the two differ little over the
    displacements of one wheel. Not for soils that soften.
    """

    law_terms: ClassVar[tuple[str, ...]] = ()
    load_rises: ClassVar[bool] = True
    share: Annotated[Real, Parameter("1", 0.0, 1.0, "share of the hyperbola")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        sheared = stress.contact.shear_displacement
        xp = namespace(sheared)
        # the ratio of the curves has a limit where neither has moved
        moved = xp.maximum(xp.abs(sheared), xp.full_like(sheared, 1e-30))
        moved = moved / load_case.soil.shear_modulus
        ratio = moved / (1.0 + moved) / -xp.expm1(-moved)
        factor = 1.0 + self.scaled(self.share, load_case) * (ratio - 1.0)
        return replace(stress, shear=stress.shear * factor)


#: Normal stress (Pa) at which the strength is that of the straight envelope, and the smallest.
AT_STRESS, SMALLEST_STRESS = 1e4, 1e-20


@effect(
    "curved-envelope",
    source="Charles and Watts 1980, Geotechnique 30(4); Baker 2004",
    kind="soil",
    reference={"exponent": 0.2},
    isolate="shear tests of the soil under a wide range of pressures; a wide range of loads",
    family="strength envelope",
)
class CurvedEnvelope(SlipLoadScaling):
    r"""The strength envelope is curved: friction falls with the normal stress.

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
