"""A hidden mechanism: functions that act at the stages of the wheel model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from datagen.blind_sets.wheel_state import (
    ContactArc,
    ContactPoints,
    Floats,
    SoilReaction,
    WheelState,
)


@final
@dataclass(frozen=True, kw_only=True)
class Mechanism:
    """A mechanism: its name, the form of its law, its size and the stages at which it acts.

    Each function takes the value of its stage, the states that the value belongs to, and last the
    size of the mechanism in `unit`; None at stages where it does not act. `form` names a law that
    differs from that of the analyst's effect of the same name; it is empty where they agree.
    """

    name: str
    size: str
    reference: float
    unit: str
    form: str = ""
    #: from reported to true slip and load
    driven: Callable[[WheelState, float], WheelState] | None = None
    #: the soil under this wheel
    soil: Callable[[WheelState, float], WheelState] | None = None
    arc: Callable[[ContactArc, WheelState, float], ContactArc] | None = None
    #: normal stress and its depth, (points, n)
    pressure: Callable[[Floats, Floats, WheelState, float], Floats] | None = None
    shear: Callable[[ContactPoints, ContactArc, WheelState, float], Floats] | None = None
    #: within the search for equilibrium
    force: Callable[[SoilReaction, ContactArc, WheelState, float], SoilReaction] | None = None
    #: from the forces at equilibrium to the readings, for the true slip and load
    reading: Callable[[SoilReaction, WheelState, float], SoilReaction] | None = None
    #: the covariate, a field of `WheelState`, that must vary for the mechanism to have an effect
    needs: str = ""

    @property
    def key(self) -> str:
        """Name and form: slip-sinkage, slip-sinkage/lyasko."""
        return f"{self.name}/{self.form}" if self.form else self.name


#: Mechanisms that act together, each with its size.
ActiveMechanisms = tuple[tuple[Mechanism, float], ...]
