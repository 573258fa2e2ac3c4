"""Climbing ability of a rover, predicted from gentle slopes and artificial slip.

`identify_ground` estimates cohesion, friction angle and shear modulus from `Climb`s.
`StressBySlip.fit` describes the stress on the rims as a function of slip. `climbing_ability`
predicts drawbar pull and slope against slip; `quantile_band` summarises the samples.
`SimulatedRover` provides climbs on a known soil.

Source: Nagatani et al., online estimation of climbing ability.
"""

from soilml.numerics.quantiles import quantile_band
from soilml.systems.climbing.ability import ClimbingAbility, climbing_ability
from soilml.systems.climbing.climb import Climb, Rover, Uncertainty, WheelRun
from soilml.systems.climbing.climb_balances import modulus_per_climb
from soilml.systems.climbing.identify import GroundEstimate, identify_ground
from soilml.systems.climbing.simulated_rover import SimulatedRover
from soilml.systems.climbing.stress_by_slip import StressBySlip

__all__ = [
    "Climb",
    "ClimbingAbility",
    "GroundEstimate",
    "Rover",
    "SimulatedRover",
    "StressBySlip",
    "Uncertainty",
    "WheelRun",
    "climbing_ability",
    "identify_ground",
    "modulus_per_climb",
    "quantile_band",
]
