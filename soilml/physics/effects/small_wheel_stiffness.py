"""Small-wheel stiffness."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.physics.load_case import LoadCase
from soilml.physics.soils import Soil

LARGE = 0.5  # Diameter (m) from which the curve of a plate holds for wheels


@final
@dataclass(frozen=True, kw_only=True)
class SmallWheelStiffness(SlipLoadScaling):
    r"""The pressure-sinkage curve depends on how large the wheel is.

    .. math:: \sigma = k z^n (D / D_0)^m, \quad D = 2 r, \quad D_0 = 0.5 m

    References: Meirion-Griffith and Spenko, J. Terramechanics 48(2), 2011, the pressure-sinkage
    model for small wheels, sigma = k z^n D^m; dividing by half a metre, above which they find
    Bekker's curve to hold, is ours and keeps the units of k. With wheels of one size it is a
    change of k_c and k_phi and of nothing else.
    """

    name: ClassVar[str] = "small-wheel-stiffness"
    about: ClassVar[EffectCard] = EffectCard(
        text="the soil's stiffness depends on the diameter of the wheel",
        source="Meirion-Griffith and Spenko 2011, J. Terramechanics 48(2)",
        kind="soil",
        reference={"exponent": -0.3},
        signs={"sinkage": -1},
        varied="wheels of several diameters: with one it is a change of kc and kphi",
        varied_dimension="radius",
        isolate="the same runs with a wheel of another diameter; plate tests of the soil",
    )
    law_terms: ClassVar[tuple[str, ...]] = ("by_load",)
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    exponent: Annotated[Real, Parameter("1", -2.0, 0.0, "m, power of the diameter")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        xp = namespace(load_case.at.slip)
        diameter = 2.0 * load_case.gear.radius
        stiffer = xp.exp(self.scaled(self.exponent, load_case) * xp.log(diameter / LARGE))
        return replace(soil, kc=soil.kc * stiffer, kphi=soil.kphi * stiffer)
