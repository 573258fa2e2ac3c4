"""Wheel-legs: walking by resistive-force theory, and soil and slip from their strides.

`walk` simulates `WheelLeg`s on `LinearGround`s over time and `gait_metrics` summarises a turn.
`soil_of_strides` estimates the soil from torque, vibration and sinkage, `mobility` says what it
means for a heavy rover, and `slip_of_strides` gives the slip on a known soil. Source: Comin and
Saaj, IEEE Transactions on Robotics 33(6), 2017.
"""

from soilml.systems.wheel_legs.resistive_force import LinearGround, WheelLeg, wheel_leg
from soilml.systems.wheel_legs.stances import SpringLeg, simulate_stance, vibration_amplitude
from soilml.systems.wheel_legs.stride_relations import LegSoil, StrideRelation, soil_of_sinkage
from soilml.systems.wheel_legs.strides import (
    Mobility,
    StrideSoil,
    mobility,
    slip_of_strides,
    soil_of_strides,
)
from soilml.systems.wheel_legs.walk import Walk, WalkStatus, gait_metrics, walk

__all__ = [
    "LegSoil", "LinearGround", "Mobility", "SpringLeg", "StrideRelation", "StrideSoil",
    "Walk", "WalkStatus", "WheelLeg", "gait_metrics", "mobility", "simulate_stance",
    "slip_of_strides", "soil_of_sinkage", "soil_of_strides", "vibration_amplitude", "walk",
    "wheel_leg",
]  # fmt: skip
