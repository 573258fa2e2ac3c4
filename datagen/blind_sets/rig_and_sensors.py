"""Causes that sit in sensors and in the rig, not in the soil."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from datagen.blind_sets.mechanism import Cause
from datagen.blind_sets.wheel_state import Arc, Push, Rows


def _slope_driven(rows: Rows, angle: float) -> Rows:
    return replace(rows, load=rows.load * math.cos(angle))


def _slope_reading(push: Push, rows: Rows, angle: float) -> Push:
    """The driven rows hold the part of the weight that stands on the bed."""
    return replace(push, pull=push.pull - rows.load * math.tan(angle))


def _load_transfer(push: Push, arc: Arc, rows: Rows, ratio: float) -> Push:
    """The soil carries W + ratio DP where W is reported."""
    return replace(push, load=push.load - ratio * push.pull)


def _bearing_friction(push: Push, rows: Rows, coefficient: float) -> Push:
    return replace(push, torque=push.torque + coefficient * rows.load * rows.radius)


def _torque_gain(push: Push, rows: Rows, gain: float) -> Push:
    return replace(push, torque=push.torque * (1.0 + gain))


def _torque_offset(push: Push, rows: Rows, offset: float) -> Push:
    return replace(push, torque=push.torque + offset)


def _drawbar_gain(push: Push, rows: Rows, gain: float) -> Push:
    return replace(push, pull=push.pull * (1.0 + gain))


def _drawbar_offset(push: Push, rows: Rows, offset: float) -> Push:
    return replace(push, pull=push.pull + offset)


def _sinkage_gain(push: Push, rows: Rows, gain: float) -> Push:
    return replace(push, sinkage=push.sinkage * (1.0 + gain))


def _sinkage_offset(push: Push, rows: Rows, offset: float) -> Push:
    return replace(push, sinkage=push.sinkage + offset)


def _load_gain(rows: Rows, gain: float) -> Rows:
    return replace(rows, load=rows.load / (1.0 + gain))


def _slip_scale(rows: Rows, scale: float) -> Rows:
    """1 - s' = (1 - s)(1 + e), s what the wheel does and s' what is reported."""
    return replace(rows, slip=np.asarray(1.0 - (1.0 - rows.slip) / (1.0 + scale)))


#: The rig: an unmeasured slope, load carried by the pull, friction in the wheel's bearing.
RIG = (
    Cause(
        name="slope",
        size="angle",
        reference=math.radians(1.0),
        unit="rad",
        driven=_slope_driven,
        reading=_slope_reading,
    ),
    Cause(name="load-transfer", size="ratio", reference=0.1, unit="1", force=_load_transfer),
    Cause(
        name="bearing-friction",
        size="coefficient",
        reference=0.01,
        unit="1",
        reading=_bearing_friction,
    ),
)

#: Sensors alone.
SENSORS = (
    Cause(name="torque-gain", size="gain", reference=0.03, unit="1", reading=_torque_gain),
    Cause(name="torque-offset", size="offset", reference=0.1, unit="N m", reading=_torque_offset),
    Cause(name="drawbar-gain", size="gain", reference=0.03, unit="1", reading=_drawbar_gain),
    Cause(name="drawbar-offset", size="offset", reference=0.5, unit="N", reading=_drawbar_offset),
    Cause(name="sinkage-gain", size="gain", reference=0.03, unit="1", reading=_sinkage_gain),
    Cause(name="sinkage-offset", size="offset", reference=0.001, unit="m", reading=_sinkage_offset),
    Cause(name="load-gain", size="gain", reference=0.03, unit="1", driven=_load_gain),
    Cause(name="slip-scale", size="scale", reference=0.015, unit="1", driven=_slip_scale),
)
