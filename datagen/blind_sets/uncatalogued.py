"""Mechanisms that no effect of the analyst describes: other forms of known laws, other causes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from datagen.blind_sets.catalogued import substitute_circle
from datagen.blind_sets.reference_wheel import (
    ContactArc,
    ContactPoints,
    Floats,
    SoilReaction,
    WheelState,
    ground_reaction,
    mechanism,
    solve_equilibrium,
)


@mechanism("B", "slip-sinkage", "share", 1.0, "1", "soil", form="lyasko")
def _lyasko(rows: WheelState, share: float) -> WheelState:
    """z = z0 (1 + s) / (1 - s / 2), by softening the soil until the sinkage has this value.

    At a fixed sinkage the load is linear in the modulus, so two evaluations give the factor.
    """
    ratio = (1.0 + rows.slip) / (1.0 - 0.5 * rows.slip)
    z = solve_equilibrium(rows).sinkage * (1.0 + share * (ratio - 1.0))
    with np.errstate(invalid="ignore"):
        x = 2.0 * np.arcsin(np.sqrt(z / (2.0 * rows.radius)))
    full_load = ground_reaction(x, rows).load
    none = np.zeros_like(rows.kc)
    cohesive_load = ground_reaction(x, replace(rows, kc=none, kphi=none)).load
    factor = (rows.load - cohesive_load) / (full_load - cohesive_load)
    factor = np.where(factor > 0.0, factor, np.nan)
    return replace(rows, kc=rows.kc * factor, kphi=rows.kphi * factor)


@mechanism("B", "slip-sinkage", "n2", 0.8, "1", "soil", form="square")
def _square(rows: WheelState, n2: float) -> WheelState:
    return replace(rows, n=rows.n + n2 * rows.slip**2)


@mechanism("B", "bulldozing", "coefficient", 0.8, "N^0.5", "force", form="root-load")
def _root_load(reaction: SoilReaction, rows: WheelState, coefficient: float) -> SoilReaction:
    return replace(reaction, pull=reaction.pull - coefficient * np.sqrt(rows.load))


@mechanism("B", "bulldozing", "coefficient", 3000.0, "N/m^1.5", "force", form="depth-power")
def _depth_power(reaction: SoilReaction, rows: WheelState, coefficient: float) -> SoilReaction:
    return replace(reaction, pull=reaction.pull - coefficient * reaction.sinkage**1.5)


@mechanism("B", "wheel-flexibility", "delta_max", 0.003, "m", "arc", form="saturating")
def _saturating_wheel(arc: ContactArc, rows: WheelState, most: float) -> ContactArc:
    return substitute_circle(arc, rows, most * -np.expm1(-rows.load / 60.0))


@mechanism("B", "exit-angle", "b", 0.15, "rad", "arc", form="constant")
def _constant_exit(arc: ContactArc, rows: WheelState, angle: float) -> ContactArc:
    return replace(arc, exit=np.full_like(arc.exit, -angle))


@mechanism("B", "exit-angle", "b0", 0.3, "1", "arc", form="proportional")
def _proportional_exit(arc: ContactArc, rows: WheelState, share: float) -> ContactArc:
    return replace(arc, exit=-share * arc.entry)


@mechanism("B", "grousers", "height", 0.012, "m", "arc", form="saturating")
def _saturating_grousers(arc: ContactArc, rows: WheelState, height: float) -> ContactArc:
    out = 0.75 * height * -np.expm1(-rows.slip / 0.15)
    return replace(arc, shear_radius=arc.shear_radius + out, lever=arc.lever + out)


@mechanism("B", "stress-shift", "growth", 0.5, "1", "arc", form="with-slip")
def _growing_shift(arc: ContactArc, rows: WheelState, growth: float) -> ContactArc:
    shift = np.minimum(growth * rows.slip, 0.9)
    return replace(
        arc,
        peak=arc.peak + shift * (arc.entry - arc.peak),
        exit=arc.exit + shift * (arc.entry - arc.exit),
    )


@mechanism("B", "rate", "m", 0.06, "1", "shear", form="power", needs="speed")
def _rate_power(points: ContactPoints, rows: WheelState, m: float) -> Floats:
    return np.asarray(points.shear * (rows.speed / 0.05) ** m)


@mechanism("B", "multipass", "growth", 0.8, "1", "soil", form="saturating", needs="pass_number")
def _saturating_passes(rows: WheelState, growth: float) -> WheelState:
    stiffer = 1.0 - growth * np.expm1(-(rows.pass_number - 1.0) / 1.5)
    return replace(rows, kc=rows.kc * stiffer, kphi=rows.kphi * stiffer)


@mechanism("B", "lateral-slip", "share", 1.0, "1", "shear", form="velocity", needs="slip_angle")
def _along_velocity(points: ContactPoints, rows: WheelState, share: float) -> Floats:
    """Shear has the direction of the slip velocity at each point, not of the displacement."""
    aside = rows.travel_ratio * np.tan(rows.slip_angle) * share
    j = np.hypot(points.shear_displacement, points.travel * aside)
    along = 1.0 - rows.travel_ratio * np.cos(points.theta)
    tau = points.strength * -np.expm1(-j / rows.shear_modulus)
    return np.asarray(tau * along / np.hypot(along, aside))


@mechanism("C", "stick-slip", "depth", 0.1, "1", "reading")
def _stick_slip(reaction: SoilReaction, rows: WheelState, depth: float) -> SoilReaction:
    """Torque dips in a band of slip, more for a heavier wheel."""
    band = np.exp(-(((rows.slip - 0.25) / 0.08) ** 2))
    return replace(reaction, torque=reaction.torque * (1.0 - depth * band * rows.load / 100.0))


@mechanism("C", "ripple", "height", 0.08, "1", "reading")
def _ripple(reaction: SoilReaction, rows: WheelState, height: float) -> SoilReaction:
    """Sinkage varies periodically with load, as over a compaction pattern."""
    wave = np.sin(2.0 * np.pi * rows.load / 35.0)
    return replace(reaction, sinkage=reaction.sinkage * (1.0 + height * wave))


@mechanism("C", "cable-drag", "drag", 4.0, "N", "reading")
def _cable_drag(reaction: SoilReaction, rows: WheelState, drag: float) -> SoilReaction:
    """Drag of a cable, which grows with slip and load."""
    pulled = (rows.slip / 0.5) ** 3 * (rows.load / 100.0) ** 2
    return replace(reaction, pull=reaction.pull - drag * pulled)


@mechanism("C", "stiff-layer", "ratio", 1.5, "1", "pressure")
def _stiff_layer(normal: Floats, depth: Floats, rows: WheelState, ratio: float) -> Floats:
    """Below 6 mm the stiffness is larger by `ratio` times that of the surface."""
    below = np.maximum(depth - 0.006, 0.0)
    return np.asarray(normal + ratio * (rows.kc / rows.width + rows.kphi) * below**rows.n)


@mechanism("C", "vibration", "loss", 0.12, "1", "soil")
def _vibration(rows: WheelState, loss: float) -> WheelState:
    """Above a slip of 0.35, vibration reduces the friction by the fraction `loss`."""
    shaken = 1.0 / (1.0 + np.exp(-(rows.slip - 0.35) / 0.02))
    tan = np.tan(rows.friction_angle) * (1.0 - loss * shaken)
    return replace(rows, friction_angle=np.arctan(tan))


@mechanism("C", "crust", "strength", 4000.0, "Pa", "pressure")
def _crust(normal: Floats, depth: Floats, rows: WheelState, strength: float) -> Floats:
    """A crust adds pressure (Pa) near the surface and is broken below."""
    x = depth / 0.004
    return np.asarray(normal + strength * x * np.exp(1.0 - x))
