"""Shear softening."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class ShearSoftening(SlipLoadScaling):
    r"""The shear stress peaks and falls to a residual, as in dense sand.

    .. math::
        m_W = K_r \left\{1 + \left[\frac{1}{K_r (1 - 1/e)} - 1\right] e^{1 - j / K_w}\right\}
        (1 - e^{-j / K_w}), \qquad
        \tau \leftarrow \tau \left[1 + a \left(\frac{m_W}{1 - e^{-j / K}} - 1\right)\right]

    with j the size of the shear displacement: a = 1 is Wong's curve, which is 1 at j = K_w, a = 0
    that of Janosi and Hanamoto. References: Wong, Theory of Ground Vehicles, chapter 2, shear
    curve with a hump; printed in Wang et al. 2018, eq. 6. Blending the two is ours. With K free it
    changes hardly anything that a wheel can feel.
    """

    name: ClassVar[str] = "shear-softening"
    about: ClassVar[EffectCard] = EffectCard(
        text="shear stress peaks and falls to a residual: dense sand, crusts",
        source="Wong, Theory of Ground Vehicles, ch. 2; Wang et al. 2018, eq. 6",
        kind="soil",
        reference={"share": 0.5},
        signs={},
        isolate="a shear-ring test of the soil; runs from the smallest to the largest slip",
        family="shear law",
    )
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
