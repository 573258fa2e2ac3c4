"""Mechanisms of the sensors and of the rig."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from datagen.blind_sets.mechanism import Mechanism
from datagen.blind_sets.wheel_state import ContactArc, SoilReaction, WheelState


def _slope_driven(rows: WheelState, angle: float) -> WheelState:
    return replace(rows, load=rows.load * math.cos(angle))


def _slope_reading(reaction: SoilReaction, rows: WheelState, angle: float) -> SoilReaction:
    """The load of `rows` is the component of the weight normal to the slope."""
    return replace(reaction, pull=reaction.pull - rows.load * math.tan(angle))


def _load_transfer(
    reaction: SoilReaction, arc: ContactArc, rows: WheelState, ratio: float
) -> SoilReaction:
    """The soil carries W + ratio DP where W is reported."""
    return replace(reaction, load=reaction.load - ratio * reaction.pull)


def _bearing_friction(reaction: SoilReaction, rows: WheelState, coefficient: float) -> SoilReaction:
    return replace(reaction, torque=reaction.torque + coefficient * rows.load * rows.radius)


def _torque_gain(reaction: SoilReaction, rows: WheelState, gain: float) -> SoilReaction:
    return replace(reaction, torque=reaction.torque * (1.0 + gain))


def _torque_offset(reaction: SoilReaction, rows: WheelState, offset: float) -> SoilReaction:
    return replace(reaction, torque=reaction.torque + offset)


def _drawbar_gain(reaction: SoilReaction, rows: WheelState, gain: float) -> SoilReaction:
    return replace(reaction, pull=reaction.pull * (1.0 + gain))


def _drawbar_offset(reaction: SoilReaction, rows: WheelState, offset: float) -> SoilReaction:
    return replace(reaction, pull=reaction.pull + offset)


def _sinkage_gain(reaction: SoilReaction, rows: WheelState, gain: float) -> SoilReaction:
    return replace(reaction, sinkage=reaction.sinkage * (1.0 + gain))


def _sinkage_offset(reaction: SoilReaction, rows: WheelState, offset: float) -> SoilReaction:
    return replace(reaction, sinkage=reaction.sinkage + offset)


def _load_gain(rows: WheelState, gain: float) -> WheelState:
    return replace(rows, load=rows.load / (1.0 + gain))


def _slip_scale(rows: WheelState, scale: float) -> WheelState:
    """u' = u (1 + e), u the true travel ratio v / (r omega) and u' the reported one."""
    travel = rows.travel_ratio / (1.0 + scale)
    return replace(rows, slip=np.where(travel > 1.0, 1.0 / travel - 1.0, 1.0 - travel))


#: The rig: an unmeasured slope, load carried by the pull, friction in the wheel's bearing.
RIG_MECHANISMS = (
    Mechanism(
        name="slope",
        size="angle",
        reference=math.radians(1.0),
        unit="rad",
        driven=_slope_driven,
        reading=_slope_reading,
    ),
    Mechanism(name="load-transfer", size="ratio", reference=0.1, unit="1", force=_load_transfer),
    Mechanism(
        name="bearing-friction",
        size="coefficient",
        reference=0.01,
        unit="1",
        reading=_bearing_friction,
    ),
)

#: Sensors alone.
SENSOR_MECHANISMS = (
    Mechanism(name="torque-gain", size="gain", reference=0.03, unit="1", reading=_torque_gain),
    Mechanism(
        name="torque-offset", size="offset", reference=0.1, unit="N m", reading=_torque_offset
    ),
    Mechanism(name="drawbar-gain", size="gain", reference=0.03, unit="1", reading=_drawbar_gain),
    Mechanism(
        name="drawbar-offset", size="offset", reference=0.5, unit="N", reading=_drawbar_offset
    ),
    Mechanism(name="sinkage-gain", size="gain", reference=0.03, unit="1", reading=_sinkage_gain),
    Mechanism(
        name="sinkage-offset", size="offset", reference=0.001, unit="m", reading=_sinkage_offset
    ),
    Mechanism(name="load-gain", size="gain", reference=0.03, unit="1", driven=_load_gain),
    Mechanism(name="slip-scale", size="scale", reference=0.015, unit="1", driven=_slip_scale),
)
