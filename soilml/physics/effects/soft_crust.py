"""Soft crust."""

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
class SoftCrust(SlipLoadScaling):
    r"""A soft or loose layer lies on firmer ground: the pressure lacks a share at small depth.

    .. math:: \sigma \leftarrow \sigma - p_0 (1 - e^{-\sigma / p_0})

    with the deficit p_0: hardly any pressure where the ground below would bear less than p_0, and
    less by p_0 where it bears much more. References: Wong, Theory of Ground Vehicles, chapter 2,
    layered terrain; the form is ours: the integral of the missing bearing over a thin layer is a
    constant below it. Strength stays that of the ground. It does not hold for a wheel that stays
    within the layer, whose soil it is.
    """

    name: ClassVar[str] = "soft-crust"
    about: ClassVar[EffectCard] = EffectCard(
        text="a soft layer on firmer ground carries less than the ground",
        source="Wong, Theory of Ground Vehicles, ch. 2",
        kind="soil",
        reference={"deficit": 1500.0},
        signs={"sinkage": 1},
        isolate="a plate or a rod pressed down through the layer; lighter loads, which stay in it",
        family="pressure by sinkage",
    )
    law_terms: ClassVar[tuple[str, ...]] = ()
    load_rises: ClassVar[bool] = True
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel, Track)
    deficit: Annotated[Real, Parameter("Pa", 0.0, 50_000.0, "p0, pressure that is missing")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        xp = namespace(stress.normal)
        p0 = self.scaled(self.deficit, load_case) + 0.0 * stress.normal
        least = xp.maximum(p0, xp.full_like(p0, 1e-6))  # zero divides
        share = 1.0 - xp.exp(-stress.normal / least)
        return with_normal(stress, stress.normal - p0 * share, load_case.soil)
