"""The table [wheel_leg] of a map: a wheel with legs, whose rows are stances."""

from __future__ import annotations

import math
from dataclasses import dataclass

from soilml.io.toml_settings import Settings
from soilml.log_import.mapping.uncertain_value import Uncertain, take_uncertain

_FEWEST, _MOST = 3, 12
_ZERO = Uncertain(0.0)


@dataclass(frozen=True)
class WheelLegMap:
    """A wheel-leg of a log.

    legs: How many legs it has.
    length: From the axle to the end of a leg, m.
    zero: Angle at which a leg points straight down, rad; None where the log is to say.
    sensor_height: Height of the range-finder of [clearance] above the axle, m.
    half_width: Half of the angle around midstance over which sensors are averaged, rad.
    """

    legs: int
    length: Uncertain
    zero: float | None = None
    sensor_height: Uncertain = _ZERO
    half_width: float = 0.1

    @property
    def spacing(self) -> float:
        """Angle between neighbouring legs, rad: that of a stance."""
        return 2.0 * math.pi / self.legs


def take_wheel_leg(settings: Settings) -> WheelLegMap:
    """Read [wheel_leg]; raises `InputError` for what is missing, unknown or wrong."""
    legs = settings.count("legs")
    if not _FEWEST <= legs <= _MOST:
        settings.fail(f"legs is {legs}; needed are {_FEWEST} to {_MOST}")
    zero = take_uncertain(settings, "zero", "rad").value if "zero" in settings else None
    settings.permit(["zero"])
    found = WheelLegMap(
        legs,
        take_uncertain(settings, "length", "m", lower=0.0),
        zero,
        take_uncertain(settings, "sensor_height", "m", _ZERO),
        take_uncertain(settings, "half_width", "rad", Uncertain(WheelLegMap.half_width)).value,
    )
    if not 0.0 < found.half_width < found.spacing / 4.0:
        settings.fail(
            f"half_width is {found.half_width:g} rad; needed is a number above 0 and below a "
            f"quarter of the {found.spacing:.3g} rad between legs"
        )
    settings.finish()
    return found
