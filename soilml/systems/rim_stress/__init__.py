"""Wheels with force sensors in their rims: from readings to shear modulus, pull and slope.

Readings of one wheel (`SensorReadings`, or a measured `StressProfile`) give k_x of each steady
run, and pull and slope by one of them (`solve_runs`). Climbs of a rover with two such wheels
(`Climb`) give the soil (`identify_ground`) and the slope that it can climb (`climbing_ability`).
Sources: Nagatani, Ikeda, Sato and Yoshida, IROS 2009; Nagatani et al., online estimation of
climbing ability.
"""

from soilml.systems.rim_stress.ability import ClimbingAbility, climbing_ability
from soilml.systems.rim_stress.climb import Climb, Rover, Uncertainty, WheelRun
from soilml.systems.rim_stress.climb_balances import modulus_per_climb
from soilml.systems.rim_stress.deconvolution import deconvolve
from soilml.systems.rim_stress.force_balance import (
    MohrCoulomb,
    SteadyRun,
    find_modulus,
    force_components,
)
from soilml.systems.rim_stress.ground import GroundEstimate, identify_ground
from soilml.systems.rim_stress.runs_on_slopes import RunsOnSlopes, solve_runs
from soilml.systems.rim_stress.sensor_readings import (
    MeasuredStress,
    SensingWheel,
    SensorReadings,
    bin_stress,
    simulate_readings,
)
from soilml.systems.rim_stress.simulated_rover import SimulatedRover, balanced_arc, parabolic_arc
from soilml.systems.rim_stress.stress_by_slip import StressBySlip
from soilml.systems.rim_stress.stress_profile import StressProfile

__all__ = [
    "Climb",
    "ClimbingAbility",
    "GroundEstimate",
    "MeasuredStress",
    "MohrCoulomb",
    "Rover",
    "RunsOnSlopes",
    "SensingWheel",
    "SensorReadings",
    "SimulatedRover",
    "SteadyRun",
    "StressBySlip",
    "StressProfile",
    "Uncertainty",
    "WheelRun",
    "balanced_arc",
    "bin_stress",
    "climbing_ability",
    "deconvolve",
    "find_modulus",
    "force_components",
    "identify_ground",
    "modulus_per_climb",
    "parabolic_arc",
    "simulate_readings",
    "solve_runs",
]
