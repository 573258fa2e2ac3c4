"""Cohesion drift."""

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
class CohesionDrift(SlipLoadScaling):
    r"""The soil gains or loses cohesion during the campaign, as it dries or is wetted.

    .. math:: c \leftarrow \max(c + c_1 p, 0)

    with p from 0 at the first row to 1 at the last, by time where it is known, else by the order of
    the rows; where p is not known the campaign is over, p = 1. The soil of the model is that of the
    first row. References: Fredlund, Morgenstern and Widger, Can. Geotech. J. 15(3), 1978,
    cohesion c' + (u_a - u_w) tan(phi_b), which grows with the suction u_a - u_w of a soil that
    dries; the straight line is ours. Friction and stiffness stay.
    """

    name: ClassVar[str] = "cohesion-drift"
    about: ClassVar[EffectCard] = EffectCard(
        text="the soil gains or loses cohesion during the campaign: drying, wetting",
        source="Fredlund et al. 1978, Can. Geotech. J. 15(3)",
        kind="soil",
        reference={"gain": 500.0},
        signs={"torque": +1, "drawbar_pull": +1},
        isolate="the first run again at the end of the campaign; the moisture of the soil",
        uses=("progress",),
    )
    law_terms: ClassVar[tuple[str, ...]] = ()
    gain: Annotated[Real, Parameter("Pa", -1e4, 1e4, "c_1, gained in the campaign")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        cohesion = soil.cohesion + self.scaled(self.gain, load_case) * campaign_share(load_case.at)
        return replace(soil, cohesion=namespace(cohesion).maximum(cohesion, 0.0 * cohesion))
