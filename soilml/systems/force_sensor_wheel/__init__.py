"""A wheel with force sensors in its rim: from readings to shear modulus and drawbar pull.

Readings of the sensors (`SensorReadings`) are averaged in bins of angle (`bin_stress`), and the
averaging over the sensor's disc is removed (`deconvolve`). The resulting `StressProfile` is
integrated to load, drawbar pull and torque (`forces_from_profile`). `estimate_shear_modulus` solves
the force balance of a `SteadyRun`, and `predict_pull` predicts the pull at another slip. Source:
Nagatani, Ikeda, Sato and Yoshida, IROS 2009.
"""

from soilml.systems.force_sensor_wheel.deconvolution import deconvolve
from soilml.systems.force_sensor_wheel.force_balance import (
    BalanceSolution,
    MohrCoulomb,
    SteadyRun,
    balanced_arc,
    parabolic_arc,
    solve_force_balance,
)
from soilml.systems.force_sensor_wheel.pull_prediction import PullPrediction, predict_pull
from soilml.systems.force_sensor_wheel.sensor_readings import (
    BinnedStress,
    SensingWheel,
    SensorReadings,
    bin_stress,
    simulate_readings,
)
from soilml.systems.force_sensor_wheel.shear_modulus import (
    ShearModulusEstimate,
    estimate_shear_modulus,
    profile_from_readings,
)
from soilml.systems.force_sensor_wheel.stress_profile import StressProfile, bekker_stress_profile
from soilml.systems.force_sensor_wheel.wheel_forces import WheelForces, forces_from_profile

__all__ = [
    "BalanceSolution",
    "BinnedStress",
    "MohrCoulomb",
    "PullPrediction",
    "SensingWheel",
    "SensorReadings",
    "ShearModulusEstimate",
    "SteadyRun",
    "StressProfile",
    "WheelForces",
    "balanced_arc",
    "bekker_stress_profile",
    "bin_stress",
    "deconvolve",
    "estimate_shear_modulus",
    "forces_from_profile",
    "parabolic_arc",
    "predict_pull",
    "profile_from_readings",
    "simulate_readings",
    "solve_force_balance",
]
