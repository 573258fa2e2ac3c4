"""Causes that stand in no catalogue."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from datagen.blind_sets.mechanism import Cause
from datagen.blind_sets.wheel_state import Floats, Push, Rows


def _stick_slip(push: Push, rows: Rows, depth: float) -> Push:
    """Torque dips in a band of slip, the more the heavier the wheel."""
    band = np.exp(-(((rows.slip - 0.25) / 0.08) ** 2))
    return replace(push, torque=push.torque * (1.0 - depth * band * rows.load / 100.0))


def _ripple(push: Push, rows: Rows, height: float) -> Push:
    """A sinkage that goes up and down with load, as over a compaction pattern."""
    wave = np.sin(2.0 * np.pi * rows.load / 35.0)
    return replace(push, sinkage=push.sinkage * (1.0 + height * wave))


def _cable_drag(push: Push, rows: Rows, drag: float) -> Push:
    """A cable that is dragged along, the more of it the more the wheel slips."""
    pulled = (rows.slip / 0.5) ** 3 * (rows.load / 100.0) ** 2
    return replace(push, pull=push.pull - drag * pulled)


def _stiff_layer(normal: Floats, depth: Floats, rows: Rows, ratio: float) -> Floats:
    """Below 6 mm the soil is `ratio` times stiffer on top of what it is."""
    below = np.maximum(depth - 0.006, 0.0)
    return np.asarray(normal + ratio * (rows.kc / rows.width + rows.kphi) * below**rows.n)


def _vibration(rows: Rows, loss: float) -> Rows:
    """Above a slip of 0.35 vibration takes a share of the friction."""
    shaken = 1.0 / (1.0 + np.exp(-(rows.slip - 0.35) / 0.02))
    tan = np.tan(rows.friction_angle) * (1.0 - loss * shaken)
    return replace(rows, friction_angle=np.arctan(tan))


def _crust(normal: Floats, depth: Floats, rows: Rows, strength: float) -> Floats:
    """A crust carries pressure (Pa) near the surface and is broken further down."""
    x = depth / 0.004
    return np.asarray(normal + strength * x * np.exp(1.0 - x))


UNKNOWN = (
    Cause(name="stick-slip", size="depth", reference=0.1, unit="1", reading=_stick_slip),
    Cause(name="ripple", size="height", reference=0.08, unit="1", reading=_ripple),
    Cause(name="cable-drag", size="drag", reference=4.0, unit="N", reading=_cable_drag),
    Cause(name="stiff-layer", size="ratio", reference=1.5, unit="1", pressure=_stiff_layer),
    Cause(name="vibration", size="loss", reference=0.12, unit="1", soil=_vibration),
    Cause(name="crust", size="strength", reference=4000.0, unit="Pa", pressure=_crust),
)
