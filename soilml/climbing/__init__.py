"""Climbing ability of a rover, from gentle slopes and artificial slip."""

from soilml.climbing.ability import Ability, band, climbing_ability
from soilml.climbing.climb import Climb, Uncertainty, WheelRun
from soilml.climbing.each import modulus_of_each
from soilml.climbing.identify import Ground, identify_ground
from soilml.climbing.rover import Rover
from soilml.climbing.simulated import SimulatedRover
from soilml.climbing.stress_by_slip import StressBySlip

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
