"""Parabolic pressure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress, with_normal
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.gears.rigid_wheel import largest_pressure, way_to_peak
from soilml.physics.gears.wheel import Wheel
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class ParabolicPressure(SlipLoadScaling):
    r"""The normal stress rises and falls along a parabola between the ends of the contact.

    .. math::
        \sigma \leftarrow (1 - a) \sigma + a \sigma_m (1 - \xi^2), \quad
        \xi = \frac{\theta - \theta_m}{\theta_1 - \theta_m} \text{ before, }
        \frac{\theta_m - \theta}{\theta_m - \theta_2} \text{ behind the maximum}

    with sigma_m Bekker's pressure at the angle of the maximum. References: Soehne, Grundlagen der
    Landtechnik 5, 1953, pressure under tyres as parabolas, of second degree on soft soil; that one
    reaches from each end of the contact to the maximum is ours. Bekker's pressure with n = 1 is
    close to it where the maximum is straight below the axle. Not for `linear-wheel`, whose stresses
    are straight lines.
    """

    name: ClassVar[str] = "parabolic-pressure"
    about: ClassVar[EffectCard] = EffectCard(
        text="normal stress has the shape of a parabola along the contact",
        source="Soehne 1953, Grundlagen der Landtechnik 5",
        kind="soil",
        reference={"share": 0.5},
        signs={"sinkage": -1},
        isolate="force sensors in the rim; sinkage at several loads and slips",
        family="shape of normal stress",
    )
    law_terms: ClassVar[tuple[str, ...]] = ()
    load_rises: ClassVar[bool] = True
    gear_types: ClassVar[tuple[type, ...]] = (Wheel,)
    share: Annotated[Real, Parameter("1", 0.0, 1.0, "share of the parabola")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        xp, soil = namespace(stress.normal), load_case.soil
        way = way_to_peak(stress.contact)
        parabola = way * (2.0 - way) * largest_pressure(stress.contact, soil)
        share = self.scaled(self.share, load_case)
        normal = stress.normal + share * (parabola - stress.normal)
        return with_normal(stress, xp.maximum(normal, xp.zeros_like(normal)), soil)
