"""Load transfer."""

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
class LoadTransfer(Effect):
    r"""The rig presses the wheel down by more than its load cell says: the pull has a lever arm.

    .. math:: W = W' + \frac{h}{L} DP + W_0

    with W' as reported, h the height of the drawbar above the axle of the rig's arm and L its
    length. References: moments about the arm's joint; Wong, Theory of Ground Vehicles, chapter 3,
    load transfer by drawbar pull. The soil has to carry W, which the search for equilibrium
    balances; effects on drawbar pull that stand behind it in the model transfer no load. A load
    that the constant part would take below zero is a wheel that barely touches, 1 uN.
    """

    name: ClassVar[str] = "load-transfer"
    about: ClassVar[EffectCard] = EffectCard(
        text="drawbar pull presses the wheel down, or lifts it, past the load cell",
        source="moments about the rig's arm",
        kind="rig",
        reference={"ratio": 0.1},
        signs={},
        isolate="weighing the wheel on its stand while the drawbar is pulled by hand",
        calibration=0.03,
    )
    ratio: Annotated[Real, Parameter("1", -0.5, 0.5, "h / L, load gained per pull")] = 0.0
    offset: Annotated[Real, Parameter("N", -100.0, 100.0, "W0, load gained always")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        xp = namespace(at.load)
        load = at.load + self.offset
        return replace(at, load=xp.maximum(load, xp.full_like(load, 1e-6)))

    def on_force(self, force: Force, load_case: LoadCase) -> Force:
        return replace(force, load=force.load - self.ratio * force.drawbar_pull)
