"""Slope."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Force
from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import Operating


@final
@dataclass(frozen=True, kw_only=True)
class Slope(Effect):
    r"""The bed has an unnoticed slope: driving goes uphill, or downhill in reverse.

    .. math:: W = W' \cos\alpha, \quad DP' = DP - d W' \sin\alpha

    with primes for what is reported and d = -1 where the travel speed is given and below zero,
    else 1. References: statics of a body on a slope, as in Wong, Theory of Ground Vehicles,
    chapter 3. The soil is treated as on level ground: valid for slopes of some degrees, not for
    those on which the soil itself is close to sliding.
    """

    name: ClassVar[str] = "slope"
    about: ClassVar[EffectCard] = EffectCard(
        text="the bed is inclined: weight pulls the wheel back, or forward in reverse",
        source="statics of a body on a slope",
        kind="rig",
        reference={"angle": 0.0175},
        signs={"drawbar_pull": -1},
        isolate="the same runs driven the other way; a spirit level on the bed",
        calibration=0.005,
    )
    angle: Annotated[Real, Parameter("rad", -0.5, 0.5, "uphill is positive")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        xp = namespace(at.load)
        return replace(at, load=at.load * xp.cos(self.angle + 0.0 * at.load))

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        load, speed = load_case.at.load, load_case.at.speed  # the load across the slope by now
        xp = namespace(load)
        along = load * xp.tan(self.angle + 0.0 * load)
        if speed is not None:
            along = xp.where(speed < 0, -along, along)
        return replace(force, drawbar_pull=force.drawbar_pull - along)
