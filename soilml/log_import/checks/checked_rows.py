"""Rows with what is known of their wheel, and hints at what looks odd in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.mapping.channel_map import UNITS, ChannelMap
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.units import factor

#: Units that loggers write, by channel: one of them may have been meant by a number.
WRITTEN: dict[str, tuple[str, ...]] = {
    "wheel_speed": ("rad/s", "rpm", "deg/s"), "wheel_angle": ("rad", "deg", "turns"),
    **dict.fromkeys(("rim_speed", "ground_speed"), ("m/s", "cm/s", "mm/s", "km/h")),
    **dict.fromkeys(("position", "sinkage"), ("m", "cm", "mm")),
    **dict.fromkeys(("load", "drawbar_pull"), ("N", "kgf", "kN")),
    "torque": ("N m", "N cm", "mN m", "kgf m", "kN m"), "motor_current": ("A", "mA"),
}  # fmt: skip


@dataclass(frozen=True)
class Hint:
    """What looks odd in quantities `about`; `wrong` where the map cannot be right."""

    code: str
    text: str
    about: tuple[str, ...]
    wrong: bool = True


def other_units(role: str, read: str) -> dict[str, float]:
    """Units that a number of a channel may be in instead of `read`, and how much more that is."""
    ours, read = UNITS[role], read or UNITS[role]
    sizes = {unit: factor(unit, ours) / factor(read, ours) for unit in WRITTEN.get(role, ())}
    return {unit: size for unit, size in sizes.items() if abs(size - 1.0) > 1e-3}


@dataclass(frozen=True)
class RowsToCheck:
    """Rows with what is known of their wheel.

    quantities: Columns (rows,) by name: `slip`, `load`, ...; `rim_speed` and `speed` in the
        sensors' own direction.
    radius: Radius of the wheel of all rows or of each (rows,), m; None where it is not known.
    wheel: That of the map; None for a table of runs.
    weight: Least and largest load by the mass of the vehicle, N; None where no mass is known.
    """

    quantities: Mapping[str, Floats]
    radius: Floats | float | None = None
    wheel: WheelMap | None = None
    weight: tuple[float, float] | None = None

    def of(self, name: str) -> Floats:
        """A quantity (rows,); NaN where it is absent."""
        size = next(iter(self.quantities.values())).shape if self.quantities else (0,)
        return np.asarray(self.quantities.get(name, np.full(size, np.nan)), dtype=np.float64)

    def known(self, name: str) -> Floats:
        """The numbers of a quantity; empty where it is absent."""
        return np.asarray(self.of(name)[np.isfinite(self.of(name))])

    def role(self, *roles: str) -> str:
        """The first of these channels that the map has; "" for none, and for a table."""
        channels = self.wheel.channels if self.wheel is not None else {}
        return next((role for role in roles if role in channels), "")

    def channel(self, role: str) -> ChannelMap | None:
        """A channel of the map; None where it has none."""
        return self.wheel.channels.get(role) if self.wheel is not None else None

    def write(self, line: str, role: str) -> str:
        """What to change in the map; nothing for a table."""
        return f"; write {line} in [{role}]" if self.wheel is not None else ""

    def effort(self) -> Floats:
        """Torque over load (rows,), m; NaN where it is not known."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.of("torque") / self.of("load"))

    def units_that_give(
        self, value: float, within: tuple[float, float], **powers: int
    ) -> list[str]:
        """Each mistaken unit whose correction brings a value between two bounds.

        powers: The power with which the value grows with each channel.
        """
        found = []
        for role, power in powers.items():
            channel = self.channel(role)
            if channel is not None and channel.has_scale:
                continue  # a calibration, and no unit
            read = (channel.unit if channel is not None else "") or UNITS[role]
            for meant, size in other_units(role, read).items():
                if within[0] < value * size**power < within[1]:
                    # of a scale, people say kg
                    shown = "kg" if meant == "kgf" else meant
                    what = role.replace("_", " ")
                    found.append(f"the {what} is in {shown} and was read as {read}")
        return found
