"""Firm base."""

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
class FirmBase(SlipLoadScaling):
    r"""Loose soil lies on a firm base: below a depth the pressure rises steeply.

    .. math:: \sigma \leftarrow \sigma [1 + (a z)^m], \qquad H = 1 / a

    with H the depth at which the base has doubled the pressure, and m its steepness. References:
    Wong, Theory of Ground Vehicles, chapter 2, layered terrain: pressure that rises again where the
    plate comes near a firm layer; the form is ours. Strength stays that of the loose soil. With all
    wheels far above the base it is a larger exponent n.
    """

    name: ClassVar[str] = "firm-base"
    about: ClassVar[EffectCard] = EffectCard(
        text="a firm base below loose soil stops the wheel",
        source="Wong, Theory of Ground Vehicles, ch. 2",
        kind="soil",
        reference={"nearness": 40.0},
        signs={"sinkage": -1},
        isolate="a plate or a rod pressed down to the base; heavier loads, which come nearer to it",
        family="pressure by sinkage",
    )
    law_terms: ClassVar[tuple[str, ...]] = ()
    load_rises: ClassVar[bool] = True
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel, Track)
    nearness: Annotated[Real, Parameter("1/m", 0.0, 500.0, "a, 1 / depth of the base")] = 0.0
    steepness: Annotated[Real, Parameter("1", 1.0, 12.0, "m, power of the depth")] = 4.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        xp, depth = namespace(stress.normal), stress.contact.depth
        near = self.scaled(self.nearness, load_case) * depth
        near = xp.maximum(near, xp.full_like(near, 1e-30))  # log(0) has no derivative
        firmer = 1.0 + xp.exp(self.steepness * xp.log(near))
        return with_normal(stress, stress.normal * firmer, load_case.soil)
