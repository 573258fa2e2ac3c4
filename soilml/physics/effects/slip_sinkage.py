"""Slip-sinkage."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.load_case import LoadCase
from soilml.physics.soils import Soil


@final
@dataclass(frozen=True, kw_only=True)
class SlipSinkage(SlipLoadScaling):
    r"""A slipping wheel digs itself in: the exponent of sinkage grows with slip.

    .. math:: n = n_0 + n_1 |s|

    References: Ding, Gao, Deng, Nagatani and Yoshida, J. Terramechanics 48(1), 2011, the
    slip-dependent exponent. An empirical law for small lugged wheels in dry sand; it does not
    describe how long digging takes.

    Examples
    --------
    >>> from soilml import Model, Operating, SlipSinkage, Wheel, soil
    >>> wheel, sand = Model(Wheel(radius=0.15, width=0.12)), soil("wong1989/dry_sand")
    >>> at = Operating(slip=0.6, load=60.0)
    >>> digging = (wheel + SlipSinkage(n1=0.4))(sand, at).sinkage / wheel(sand, at).sinkage
    >>> f"{digging:.1f} times as deep"
    '1.8 times as deep'
    """

    name: ClassVar[str] = "slip-sinkage"
    about: ClassVar[EffectCard] = EffectCard(
        text="a slipping wheel digs itself in: n grows with slip",
        source="Ding et al. 2011, J. Terramechanics 48(1)",
        kind="soil",
        reference={"n1": 0.4},
        signs={"sinkage": +1},
        isolate="runs at several slips under one load, with sinkage measured",
    )
    n1: Annotated[Real, Parameter("1", 0.0, 2.0, "growth of n per unit slip")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        xp = namespace(load_case.at.slip)
        return replace(soil, n=soil.n + self.scaled(self.n1, load_case) * xp.abs(load_case.at.slip))
