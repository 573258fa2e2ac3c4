"""Climbing ability of a rover, from gentle slopes and artificial slip."""

from soilml.systems.climbing.ability import Ability, band, climbing_ability
from soilml.systems.climbing.climb import Climb, Uncertainty, WheelRun
from soilml.systems.climbing.identify import Ground, identify_ground
from soilml.systems.climbing.modulus_per_climb import modulus_of_each
from soilml.systems.climbing.rover import Rover
from soilml.systems.climbing.simulated_rover import SimulatedRover
from soilml.systems.climbing.stress_by_slip import StressBySlip

__all__ = [
    "Ability",
    "Climb",
    "Ground",
    "Rover",
    "SimulatedRover",
    "StressBySlip",
    "Uncertainty",
    "WheelRun",
    "band",
    "climbing_ability",
    "identify_ground",
    "modulus_of_each",
]
