"""The catalogue of running gears: a new gear is one new file and one line here."""

from soilml.physics.gears.base import Gear
from soilml.physics.gears.linear_wheel import LinearWheel
from soilml.physics.gears.track import Track
from soilml.physics.gears.wheel import Wheel
from soilml.physics.gears.wheel_leg_foot import Midstance

#: Gear by the name that `[gear] type` takes in a model file.
GEARS: dict[str, type[Gear]] = {gear.name: gear for gear in (Wheel, LinearWheel, Midstance, Track)}

__all__ = ["GEARS", "Gear", "LinearWheel", "Midstance", "Track", "Wheel"]
