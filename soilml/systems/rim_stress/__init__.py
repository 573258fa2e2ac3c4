"""Wheels with force sensors in their rims: from readings to shear modulus, pull and slope.

Readings of one wheel (`bin_stress`, or a measured `StressProfile`) give k_x of each steady
run, and pull and slope by one of them (`solve_runs`). Climbs of a rover with two such wheels
(`Climb`) give the soil (`identify_ground`) and the slope that it can climb (`climbing_ability`).
Sources: Nagatani, Ikeda, Sato and Yoshida, IROS 2009; Nagatani et al., online estimation of
climbing ability.
"""

from soilml.systems.rim_stress.ability import ClimbingAbility, StressBySlip, climbing_ability
from soilml.systems.rim_stress.climbs import Climb, Rover, Uncertainty, WheelRun
from soilml.systems.rim_stress.force_balance import SteadyRun
from soilml.systems.rim_stress.ground import GroundEstimate, identify_ground
from soilml.systems.rim_stress.runs_on_slopes import RunsOnSlopes, solve_runs
from soilml.systems.rim_stress.simulation import SimulatedRover, balanced_arc, simulate_readings
from soilml.systems.rim_stress.stress import (
    MeasuredStress,
    SensingWheel,
    StressProfile,
    bin_stress,
)

__all__ = [
    "Climb", "ClimbingAbility", "GroundEstimate", "MeasuredStress", "Rover",
    "RunsOnSlopes", "SensingWheel", "SimulatedRover", "SteadyRun", "StressBySlip",
    "StressProfile", "Uncertainty", "WheelRun", "balanced_arc", "bin_stress", "climbing_ability",
    "identify_ground", "simulate_readings", "solve_runs",
]  # fmt: skip
