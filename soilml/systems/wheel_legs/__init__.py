"""Wheel-legs: walking by resistive-force theory, and soil and slip from their strides.

`walk` simulates `WheelLeg`s on `LinearGround`s over time and `gait_metrics` summarises a turn.
`soil_of_strides` estimates the soil from torque, vibration and sinkage, `mobility` says what it
means for a heavy rover, and `slip_of_strides` gives the slip on a known soil. Source: Comin and
Saaj, IEEE Transactions on Robotics 33(6), 2017.
"""

from soilml.systems.wheel_legs.gaits import gait_metrics
from soilml.systems.wheel_legs.geometry import FEET, WheelLeg, wheel_leg
from soilml.systems.wheel_legs.resistive_force import GROUNDS, LinearGround
from soilml.systems.wheel_legs.stances import SpringLeg, simulate_stance, vibration_amplitude
from soilml.systems.wheel_legs.stride_relations import (
    TORQUE_SLIP,
    VIBRATION_SLIP,
    LegSoil,
    SlipRelation,
    soil_of_sinkage,
    soil_spring,
    spring_soil,
)
from soilml.systems.wheel_legs.strides import (
    Mobility,
    StrideSlip,
    StrideSoil,
    mobility,
    slip_of_strides,
    soil_of_strides,
)
from soilml.systems.wheel_legs.walk import Walk, WalkStatus, walk

__all__ = [
    "FEET",
    "GROUNDS",
    "TORQUE_SLIP",
    "VIBRATION_SLIP",
    "LegSoil",
    "LinearGround",
    "Mobility",
    "SlipRelation",
    "SpringLeg",
    "StrideSlip",
    "StrideSoil",
    "Walk",
    "WalkStatus",
    "WheelLeg",
    "gait_metrics",
    "mobility",
    "simulate_stance",
    "slip_of_strides",
    "soil_of_sinkage",
    "soil_of_strides",
    "soil_spring",
    "spring_soil",
    "vibration_amplitude",
    "walk",
    "wheel_leg",
]
