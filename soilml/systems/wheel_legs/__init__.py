"""Wheel-legs: walking by resistive-force theory, slip models, and soil parameters from both.

`walk` simulates `WheelLeg`s on `LinearGround`s over time and `gait_metrics` summarises a turn; the
slip models `TORQUE_SLIP` and `VIBRATION_SLIP`, `soil_from_torque`, `soil_from_vibration`,
`PRINTED_SINKAGE` and `fit_sinkage` estimate slip and soil from torque, vibration and sinkage.
Source: Comin and Saaj, IEEE Transactions on Robotics 33(6), 2017.
"""

from soilml.systems.wheel_legs.gait_metrics import GaitMetrics, gait_metrics
from soilml.systems.wheel_legs.geometry import FEET, WheelLeg, wheel_leg
from soilml.systems.wheel_legs.integrator import WalkStatus
from soilml.systems.wheel_legs.resistive_force import GROUNDS, LinearGround
from soilml.systems.wheel_legs.sinkage_fit import PRINTED_SINKAGE, SinkageFit, fit_sinkage
from soilml.systems.wheel_legs.slip_models import (
    TORQUE_SLIP,
    VIBRATION_SLIP,
    TorqueSlip,
    VibrationSlip,
)
from soilml.systems.wheel_legs.slip_of_strides import StrideSlip, slip_of_strides
from soilml.systems.wheel_legs.soil_from_slip import LegSoil, soil_from_torque, soil_from_vibration
from soilml.systems.wheel_legs.stances import SpringLeg, simulate_stance, vibration_amplitude
from soilml.systems.wheel_legs.walk import Walk, walk

__all__ = [
    "FEET",
    "GROUNDS",
    "PRINTED_SINKAGE",
    "TORQUE_SLIP",
    "VIBRATION_SLIP",
    "GaitMetrics",
    "LegSoil",
    "LinearGround",
    "SinkageFit",
    "SpringLeg",
    "StrideSlip",
    "TorqueSlip",
    "VibrationSlip",
    "Walk",
    "WalkStatus",
    "WheelLeg",
    "fit_sinkage",
    "gait_metrics",
    "simulate_stance",
    "slip_of_strides",
    "soil_from_torque",
    "soil_from_vibration",
    "vibration_amplitude",
    "walk",
    "wheel_leg",
]
