"""Hyperbolic shear."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class HyperbolicShear(SlipLoadScaling):
    r"""The shear stress follows a hyperbola: it starts as steeply and reaches the strength later.

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

    name: ClassVar[str] = "hyperbolic-shear"
    about: ClassVar[EffectCard] = EffectCard(
        text="shear stress rises along a hyperbola and mobilises its full strength late",
        source="Kondner 1963; Duncan and Chang 1970, ASCE 96(SM5)",
        kind="soil",
        reference={"share": 0.5},
        signs={"torque": -1, "drawbar_pull": -1},
        isolate="a shear-ring test of the soil; runs from the smallest to the largest slip",
        family="shear law",
    )
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
