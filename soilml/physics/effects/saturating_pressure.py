"""Saturating pressure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress, with_normal
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.physics.gears.track import Track
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class SaturatingPressure(SlipLoadScaling):
    r"""The pressure approaches a limit as the gear sinks: the soil yields instead of hardening.

    .. math:: \sigma \leftarrow \frac{1 - e^{-a \sigma}}{a}, \qquad \sigma_\infty = 1 / a

    of Bekker's pressure, which it is at small depths; where n = 1 it is sigma_inf (1 - e^(-z /
    z_w)). References: Wong, Theory of Ground Vehicles, chapter 2, pressure on snow,
    p_w [1 - exp(-z / z_w)]; Kacigin and Guskov, J. Terramechanics 5(3), 1968, tanh in its place.
    The exponent n beside it is ours. A load near the limit has no equilibrium, and the row says so.
    """

    name: ClassVar[str] = "saturating-pressure"
    about: ClassVar[EffectCard] = EffectCard(
        text="pressure approaches a limit with depth: heavy wheels sink further",
        source="Wong, Theory of Ground Vehicles, ch. 2; Kacigin and Guskov 1968",
        kind="soil",
        reference={"softness": 2e-5},
        signs={"sinkage": +1},
        isolate="plate tests to large sinkage; sinkage under a wide range of loads",
        family="pressure by sinkage",
    )
    law_terms: ClassVar[tuple[str, ...]] = ()
    load_rises: ClassVar[bool] = True
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel, Track)
    softness: Annotated[Real, Parameter("1/Pa", 0.0, 1e-3, "a, 1 / limit of pressure")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        xp = namespace(stress.normal)
        share = self.scaled(self.softness, load_case) * stress.normal
        share = xp.maximum(share, xp.full_like(share, 1e-30))  # the ratio has a limit at zero
        return with_normal(stress, stress.normal * (-xp.expm1(-share) / share), load_case.soil)
