"""Width in Reece's law."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.physics.gears.track import Track
from soilml.physics.load_case import LoadCase
from soilml.physics.soils import Soil

AT_WIDTH = 0.1  # Width (m) at which Reece's law and Bekker's have the same k_c and k_phi


@final
@dataclass(frozen=True, kw_only=True)
class ReeceWidth(SlipLoadScaling):
    r"""Pressure depends on sinkage over width, as Reece wrote it, and not on sinkage alone.

    .. math::
        \sigma = (k_1 + k_2 b) \left(\frac{z}{b}\right)^n
        = \left(\frac{k_1}{b} + k_2\right) b^{1 - n} z^n, \qquad
        k \leftarrow k \left(\frac{b}{b_0}\right)^{a (1 - n)}, \quad k \in \{k_c, k_\varphi\}

    with b_0 = 0.1 m: a = 1 is Reece's law, a = 0 Bekker's. References: Reece, Proc. Inst. Mech.
    Eng. 180(2A), 1965, k_1 = c k_c' and k_2 = gamma k_phi' / 2; Wong, Theory of Ground Vehicles,
    chapter 2. With gears of one width the two laws are the same, with other k_c and k_phi; and they
    are where n = 1.
    """

    name: ClassVar[str] = "reece-width"
    about: ClassVar[EffectCard] = EffectCard(
        text="pressure depends on sinkage over width: stiffness changes with width otherwise",
        source="Reece 1965, Proc. Inst. Mech. Eng. 180(2A)",
        kind="soil",
        reference={"share": 1.0},
        signs={},
        varied="wheels of several widths: with one it is a change of kc and kphi",
        varied_dimension="width",
        isolate="the same runs with a wheel of another width; plate tests with several plates",
        family="pressure by sinkage",
    )
    law_terms: ClassVar[tuple[str, ...]] = ()
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel, Track)
    share: Annotated[Real, Parameter("1", 0.0, 2.0, "times the change from Bekker's law")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        xp = namespace(load_case.at.slip)
        width = load_case.gear.width + 0.0 * load_case.at.slip
        power = self.scaled(self.share, load_case) * (1.0 - soil.n)
        times = xp.exp(power * xp.log(width / AT_WIDTH))
        return replace(soil, kc=soil.kc * times, kphi=soil.kphi * times)
