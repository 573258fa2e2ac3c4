"""Multipass."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.effects.base import EffectCard, SlipLoadScaling, covariate
from soilml.physics.load_case import LoadCase
from soilml.physics.soils import Soil


@final
@dataclass(frozen=True, kw_only=True)
class Multipass(SlipLoadScaling):
    r"""A rut is firmer than virgin soil: each wheel that passed has compacted it.

    .. math:: k \leftarrow k N^a, \quad k \in \{k_c, k_\varphi\}

    with N the number of the pass; sinkage is then measured from the bottom of the rut.
    References: Holm, J. Terramechanics 6, 1969, multi-pass behaviour of tyres; Senatore and
    Sandu, J. Terramechanics 48(4), 2011, soil parameters by pass. The power of N is ours: theirs
    are curves fitted to each soil. The slip of earlier passes has no influence, and density and
    shear strength remain those of virgin soil.
    """

    name: ClassVar[str] = "multipass"
    about: ClassVar[EffectCard] = EffectCard(
        text="soil in a rut is firmer than virgin soil",
        source="Holm 1969; Senatore and Sandu 2011, J. Terramechanics 48(4)",
        kind="soil",
        reference={"growth": 0.5},
        signs={"sinkage": -1},
        isolate="the same runs again in the same rut, and on soil prepared anew",
        needs=("pass_number",),
    )
    law_terms: ClassVar[tuple[str, ...]] = ("by_load",)
    growth: Annotated[Real, Parameter("1", 0.0, 3.0, "a, power of the pass number")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        passes = covariate(load_case, "pass_number", self.name)
        xp = namespace(passes)
        firmer = xp.exp(self.scaled(self.growth, load_case) * xp.log(passes))
        return replace(soil, kc=soil.kc * firmer, kphi=soil.kphi * firmer)
