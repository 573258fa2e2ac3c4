"""What a hidden cause is: functions that act where the physics does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from datagen.blind_sets.wheel_state import Arc, Floats, Points, Push, Rows


@final
@dataclass(frozen=True, kw_only=True)
class Cause:
    """A cause by its name, the form it takes, its size and where it acts.

    Each function takes the value of its stage, what that value belongs to, and last the size of
    the cause in `unit`; None where the cause does not act. Of a cause that stands in a catalogue
    under the same name, `form` says how its law differs; it is empty where it does not.
    """

    name: str
    size: str
    reference: float
    unit: str
    form: str = ""
    #: reported slip and load -> what the wheel does
    driven: Callable[[Rows, float], Rows] | None = None
    #: the soil as this wheel meets it
    soil: Callable[[Rows, float], Rows] | None = None
    arc: Callable[[Arc, Rows, float], Arc] | None = None
    #: normal stress and the depth it stands at, (points, n)
    pressure: Callable[[Floats, Floats, Rows, float], Floats] | None = None
    shear: Callable[[Points, Arc, Rows, float], Floats] | None = None
    #: inside the search for equilibrium
    force: Callable[[Push, Arc, Rows, float], Push] | None = None
    #: at equilibrium -> what is reported; the rows are those that were driven
    reading: Callable[[Push, Rows, float], Push] | None = None
    #: the covariate that must vary for the cause to show, a field of `Rows`
    needs: str = ""

    @property
    def key(self) -> str:
        """Name and form: slip-sinkage, slip-sinkage/lyasko."""
        return f"{self.name}/{self.form}" if self.form else self.name


#: Causes that act together, each with its size.
Acting = tuple[tuple[Cause, float], ...]
