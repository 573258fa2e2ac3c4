"""A wheel that measures the normal stress on its rim, and what follows from that."""

from soilml.systems.force_sensor_wheel.bekker_profile import conventional
from soilml.systems.force_sensor_wheel.bin_average import Felt, averaged
from soilml.systems.force_sensor_wheel.deconvolution import sharpened
from soilml.systems.force_sensor_wheel.force_balance import Balanced, solve
from soilml.systems.force_sensor_wheel.pull_prediction import Pull, pull
from soilml.systems.force_sensor_wheel.sensor_model import Readings, SensingWheel, sensed
from soilml.systems.force_sensor_wheel.shear_modulus import Grip, estimate, profiled
from soilml.systems.force_sensor_wheel.steady_run import Run, Strength
from soilml.systems.force_sensor_wheel.stress_profile import StressProfile
from soilml.systems.force_sensor_wheel.synthetic_arc import balanced_arc, stressed_arc
from soilml.systems.force_sensor_wheel.wheel_forces import WheelForces, forces

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
