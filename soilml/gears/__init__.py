"""The catalogue of running gears: a new gear is one new file and one line here."""

from soilml.gears.base import Gear
from soilml.gears.linear_wheel import LinearWheel
from soilml.gears.midstance import Midstance
from soilml.gears.track import Track
from soilml.gears.wheel import Wheel

#: Gear by the name that `[gear] type` takes in a model file.
GEARS: dict[str, type[Gear]] = {
    gear.name: gear
    for gear in (
        Wheel,
        LinearWheel,
        Midstance,
        Track,
    )
}

__all__ = ["GEARS", "Gear", "LinearWheel", "Midstance", "Track", "Wheel"]
