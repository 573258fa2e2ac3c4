"""Friction drift."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import campaign_share
from soilml.physics.soils import Soil


@final
@dataclass(frozen=True, kw_only=True)
class FrictionDrift(SlipLoadScaling):
    r"""The friction angle grows or falls during the campaign, as the soil is compacted or loosened.

    .. math:: \varphi \leftarrow \max(\varphi + \varphi_1 p, 0)

    with p from 0 at the first row to 1 at the last, by time where it is known, else by the order of
    the rows; where p is not known the campaign is over, p = 1. The soil of the model is that of the
    first row. References: Bolton, Geotechnique 36(1), 1986, the friction angle of sand grows with
    its relative density; that it does so evenly is ours. Cohesion and stiffness stay.
    """

    name: ClassVar[str] = "friction-drift"
    about: ClassVar[EffectCard] = EffectCard(
        text="the friction angle grows or falls during the campaign: compaction, loosening",
        source="Bolton 1986, Geotechnique 36(1)",
        kind="soil",
        reference={"gain": 0.05},
        signs={"torque": +1, "drawbar_pull": +1},
        isolate="the first run again at the end of the campaign; the density of the soil",
        uses=("progress",),
    )
    law_terms: ClassVar[tuple[str, ...]] = ()
    gain: Annotated[Real, Parameter("rad", -0.3, 0.3, "phi_1, gained in the campaign")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        angle = soil.friction_angle + self.scaled(self.gain, load_case) * campaign_share(
            load_case.at
        )
        return replace(soil, friction_angle=namespace(angle).maximum(angle, 0.0 * angle))
