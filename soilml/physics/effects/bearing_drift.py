"""Bearing drift."""

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
class BearingDrift(SlipLoadScaling):
    r"""The soil becomes firmer, or softer, during the campaign.

    .. math:: k \leftarrow k e^{a p}, \quad k \in \{k_c, k_\varphi\}

    with p from 0 at the first row to 1 at the last, by time where it is known, else by the order of
    the rows; where p is not known the campaign is over, p = 1. The soil of the model is that of the
    first row. References: Mitchell and Soga, Fundamentals of Soil Behavior, 2005, chapter 12,
    ageing and drying change stiffness; that it does so evenly is ours. Soil that is prepared anew
    before each run does not drift; whoever prepares it may.
    """

    name: ClassVar[str] = "bearing-drift"
    about: ClassVar[EffectCard] = EffectCard(
        text="the soil becomes firmer or softer during the campaign",
        source="Mitchell and Soga 2005, ch. 12",
        kind="soil",
        reference={"growth": 0.2},
        signs={"sinkage": -1},
        isolate="the first run again at the end of the campaign",
        uses=("progress",),
    )
    law_terms: ClassVar[tuple[str, ...]] = ()
    growth: Annotated[Real, Parameter("1", -2.0, 2.0, "a, growth of ln k in the campaign")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        growth = self.scaled(self.growth, load_case) * campaign_share(load_case.at)
        firmer = namespace(growth).exp(growth)
        return replace(soil, kc=soil.kc * firmer, kphi=soil.kphi * firmer)
