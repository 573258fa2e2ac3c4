"""A wheel that measures the normal stress on its rim, and what follows from that."""

from soilml.measured_stress.arc import balanced_arc, stressed_arc
from soilml.measured_stress.averaging import Felt, averaged
from soilml.measured_stress.balance import WheelForces, forces
from soilml.measured_stress.conventional import conventional
from soilml.measured_stress.estimating import Grip, estimate, profiled
from soilml.measured_stress.predicting import Pull, pull
from soilml.measured_stress.profile import StressProfile
from soilml.measured_stress.run import Run, Strength
from soilml.measured_stress.sensing import Readings, SensingWheel, sensed
from soilml.measured_stress.sharpening import sharpened
from soilml.measured_stress.solving import Balanced, solve

__all__ = [
    "Balanced",
    "Felt",
    "Grip",
    "Pull",
    "Readings",
    "Run",
    "SensingWheel",
    "Strength",
    "StressProfile",
    "WheelForces",
    "averaged",
    "balanced_arc",
    "conventional",
    "estimate",
    "forces",
    "profiled",
    "pull",
    "sensed",
    "sharpened",
    "solve",
    "stressed_arc",
]
