"""Catalogue of sensors that only one kind of gear has, by the table of the recipe that adds them.

A new sensor is a class with the members of `GearSensor` and a line in `GEAR_SENSORS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from datagen.wheel_leg_vibration import StickSlip
from soilml.config.case import Case
from soilml.io.toml_settings import Settings

Floats = NDArray[np.float64]


class GearSensor(Protocol):
    """A sensor whose reading depends on more than the forces, and further columns that explain it.

    `sensor` is the column of its reading; `units` has the unit of each further column that is not
    a quantity of `soilml.quantities`; `run_draws` is how many random numbers a run needs; slips
    below `lowest_slip` have no reading.
    """

    sensor: ClassVar[str]
    units: ClassVar[Mapping[str, str]]
    run_draws: ClassVar[int]
    lowest_slip: ClassVar[float]

    @classmethod
    def take(cls, settings: Settings, case: Case) -> Self:
        """Read the table of the recipe; raises `InputError` naming the key, or the wrong gear."""
        ...

    def simulate(
        self, case: Case, slip: Floats, load: Floats, lowest_load: float, u: Floats
    ) -> tuple[Floats, dict[str, Floats]]:
        """Noise-free readings (n,) and the further columns, each (n,).

        `case` has the soil of each row. `u` (n, run_draws) are uniform between 0 and 1, the same in
        all rows of a run. No load of the recipe is below `lowest_load` (N): whatever is derived
        from it does not depend on the pieces in which rows are simulated.
        """
        ...


#: Table of a recipe -> the sensor that it adds. Random streams follow this order: append only.
GEAR_SENSORS: dict[str, type[GearSensor]] = {"stick_slip": StickSlip}
