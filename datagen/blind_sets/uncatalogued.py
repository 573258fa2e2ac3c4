"""Mechanisms that are in no catalogue of the analyst."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from datagen.blind_sets.mechanism import Mechanism
from datagen.blind_sets.wheel_state import Floats, SoilReaction, WheelState


def _stick_slip(reaction: SoilReaction, rows: WheelState, depth: float) -> SoilReaction:
    """Torque dips in a band of slip, more for a heavier wheel."""
    band = np.exp(-(((rows.slip - 0.25) / 0.08) ** 2))
    return replace(reaction, torque=reaction.torque * (1.0 - depth * band * rows.load / 100.0))


def _ripple(reaction: SoilReaction, rows: WheelState, height: float) -> SoilReaction:
    """Sinkage varies periodically with load, as over a compaction pattern."""
    wave = np.sin(2.0 * np.pi * rows.load / 35.0)
    return replace(reaction, sinkage=reaction.sinkage * (1.0 + height * wave))


def _cable_drag(reaction: SoilReaction, rows: WheelState, drag: float) -> SoilReaction:
    """Drag of a cable, which grows with slip and load."""
    pulled = (rows.slip / 0.5) ** 3 * (rows.load / 100.0) ** 2
    return replace(reaction, pull=reaction.pull - drag * pulled)


def _stiff_layer(normal: Floats, depth: Floats, rows: WheelState, ratio: float) -> Floats:
    """Below 6 mm the stiffness is larger by `ratio` times that of the surface."""
    below = np.maximum(depth - 0.006, 0.0)
    return np.asarray(normal + ratio * (rows.kc / rows.width + rows.kphi) * below**rows.n)


def _vibration(rows: WheelState, loss: float) -> WheelState:
    """Above a slip of 0.35, vibration reduces the friction by the fraction `loss`."""
    shaken = 1.0 / (1.0 + np.exp(-(rows.slip - 0.35) / 0.02))
    tan = np.tan(rows.friction_angle) * (1.0 - loss * shaken)
    return replace(rows, friction_angle=np.arctan(tan))


def _crust(normal: Floats, depth: Floats, rows: WheelState, strength: float) -> Floats:
    """A crust adds pressure (Pa) near the surface and is broken below."""
    x = depth / 0.004
    return np.asarray(normal + strength * x * np.exp(1.0 - x))


UNCATALOGUED_MECHANISMS = (
    Mechanism(name="stick-slip", size="depth", reference=0.1, unit="1", reading=_stick_slip),
    Mechanism(name="ripple", size="height", reference=0.08, unit="1", reading=_ripple),
    Mechanism(name="cable-drag", size="drag", reference=4.0, unit="N", reading=_cable_drag),
    Mechanism(name="stiff-layer", size="ratio", reference=1.5, unit="1", pressure=_stiff_layer),
    Mechanism(name="vibration", size="loss", reference=0.12, unit="1", soil=_vibration),
    Mechanism(name="crust", size="strength", reference=4000.0, unit="Pa", pressure=_crust),
)
