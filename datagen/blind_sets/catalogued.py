"""Mechanisms that an effect of the analyst describes: soil and wheel, rig, sensors."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from datagen.blind_sets.reference_wheel import (
    ContactArc,
    ContactPoints,
    Floats,
    SoilReaction,
    WheelState,
    mechanism,
)


@mechanism("A", "slip-sinkage", "n1", 0.4, "1", "soil")
def _slip_sinkage(rows: WheelState, n1: float) -> WheelState:
    """Ding et al. 2011: n = n0 + n1 |s|."""
    return replace(rows, n=rows.n + n1 * np.abs(rows.slip))


@mechanism("A", "grousers", "height", 0.01, "m", "arc")
def _grousers(arc: ContactArc, rows: WheelState, height: float) -> ContactArc:
    """Ding et al. 2011: soil is shear_displacement at r + 0.75 h."""
    out = 0.75 * height
    return replace(arc, shear_radius=arc.shear_radius + out, lever=arc.lever + out)


@mechanism("A", "bulldozing", "share", 1.0, "1", "force")
def _bulldozing(reaction: SoilReaction, rows: WheelState, share: float) -> SoilReaction:
    """Bekker 1969 with the factors of local shear failure."""
    phi = np.arctan(2.0 / 3.0 * np.tan(rows.friction_angle))
    n_q = np.exp(np.pi * np.tan(phi)) * np.tan(0.25 * np.pi + 0.5 * phi) ** 2
    n_c = (n_q - 1.0) / np.tan(phi)
    n_gamma = 2.0 * (n_q + 1.0) * np.tan(phi)
    k_c = (n_c - np.tan(phi)) * np.cos(phi) ** 2
    k_gamma = (2.0 * n_gamma / np.tan(phi) + 1.0) * np.cos(phi) ** 2
    z = reaction.sinkage
    wall = 0.67 * rows.cohesion * z * k_c + 0.5 * z**2 * rows.unit_weight * k_gamma
    return replace(reaction, pull=reaction.pull - share * rows.width * wall)


@mechanism("A", "exit-angle", "kappa", 0.15, "1", "arc")
def _exit_angle(arc: ContactArc, rows: WheelState, kappa: float) -> ContactArc:
    """Ishigami et al. 2007: theta_2 = -acos(1 - kappa z / r)."""
    return replace(arc, exit=-np.arccos(1.0 - kappa * arc.sinkage / rows.radius))


@mechanism("A", "stress-shift", "shift", 0.2, "1", "arc")
def _stress_shift(arc: ContactArc, rows: WheelState, shift: float) -> ContactArc:
    """The stressed part of the rim moves towards the entry (Nagatani et al. 2009, section IV)."""
    return replace(
        arc,
        peak=arc.peak + shift * (arc.entry - arc.peak),
        exit=arc.exit + shift * (arc.entry - arc.exit),
    )


def substitute_circle(arc: ContactArc, rows: WheelState, deflection: Floats) -> ContactArc:
    """A wheel flattened by `deflection` (m, (n,)) has a contact like that of a larger circle.

    r* = r (1 + delta / z); the axle keeps its height, and the torque its lever arm r. Source:
    Schmid, J. Terramechanics 32(1), 1995.
    """
    z = np.maximum(arc.sinkage, 1e-12)
    radius = rows.radius * (1.0 + deflection / z)
    entry = 2.0 * np.arcsin(np.sqrt(z / (2.0 * radius)))
    peak = (rows.a0 + rows.a1 * rows.slip) * entry
    return replace(arc, entry=entry, peak=peak, radius=radius, shear_radius=radius)


@mechanism("A", "wheel-flexibility", "compliance", 2e-5, "m/N", "arc")
def _wheel_flexibility(arc: ContactArc, rows: WheelState, compliance: float) -> ContactArc:
    return substitute_circle(arc, rows, compliance * rows.load)


@mechanism("A", "shear-softening", "share", 0.5, "1", "shear")
def _shear_softening(points: ContactPoints, rows: WheelState, share: float) -> Floats:
    """Wong's hump, K_r = 0.7 and K_w = 1.5 K, blended in by its share."""
    x, k_r = np.abs(points.shear_displacement) / (1.5 * rows.shear_modulus), 0.7
    height = 1.0 + (1.0 / (k_r * (1.0 - np.exp(-1.0))) - 1.0) * np.exp(1.0 - x)
    hump = points.strength * k_r * height * -np.expm1(-x)
    hump = np.copysign(hump, points.shear_displacement)
    return np.asarray((1.0 - share) * points.shear + share * hump)


@mechanism("A", "sidewall-shear", "share", 1.0, "1", "force")
def _sidewall_shear(reaction: SoilReaction, rows: WheelState, share: float) -> SoilReaction:
    """The buried halves of both side walls, forward of the axle, each a segment at its centroid."""
    t, r, phi = reaction.entry, rows.radius, rows.friction_angle
    part = np.maximum(t - np.sin(t) * np.cos(t), 1e-300)
    area = 0.5 * r**2 * part
    y = 2.0 * r * np.sin(t) ** 3 / (3.0 * part)
    pressure = (1.0 - np.sin(phi)) * rows.unit_weight * (y - r * np.cos(t))
    j = r * (t - rows.travel_ratio * np.sin(t))
    mobilised = np.copysign(np.expm1(-np.abs(j) / rows.shear_modulus), j)
    tau = (rows.cohesion + pressure * np.tan(phi)) * mobilised
    both = 2.0 * share * tau * area
    return replace(reaction, pull=reaction.pull + both, torque=reaction.torque + both * y)


@mechanism("A", "depth-cohesion", "c1", 2e4, "Pa/m", "shear")
def _depth_cohesion(points: ContactPoints, rows: WheelState, c1: float) -> Floats:
    j = points.shear_displacement
    mobilised = np.copysign(np.expm1(-np.abs(j) / rows.shear_modulus), j)
    return np.asarray(points.shear + c1 * points.depth * mobilised)


@mechanism("A", "rate", "a", 0.05, "1", "shear", needs="speed")
def _rate(points: ContactPoints, rows: WheelState, a: float) -> Floats:
    return np.asarray(points.shear * (1.0 + a * np.log(rows.speed / 0.05)))


@mechanism("A", "multipass", "growth", 0.5, "1", "soil", needs="pass_number")
def _multipass(rows: WheelState, growth: float) -> WheelState:
    stiffer = rows.pass_number**growth
    return replace(rows, kc=rows.kc * stiffer, kphi=rows.kphi * stiffer)


@mechanism("A", "lateral-slip", "share", 1.0, "1", "shear", needs="slip_angle")
def _lateral_slip(points: ContactPoints, rows: WheelState, share: float) -> Floats:
    """Shear grows with both displacements and has the direction of their sum."""
    aside = share * rows.travel_ratio * np.tan(rows.slip_angle)
    j = np.hypot(points.shear_displacement, points.travel * aside)
    tau = points.strength * -np.expm1(-j / rows.shear_modulus)
    return np.asarray(tau * points.shear_displacement / j)


@mechanism("A", "slope", "angle", math.radians(1.0), "rad", "driven")
def _slope_driven(rows: WheelState, angle: float) -> WheelState:
    return replace(rows, load=rows.load * math.cos(angle))


@mechanism("A", "slope", "angle", math.radians(1.0), "rad", "reading")
def _slope_reading(reaction: SoilReaction, rows: WheelState, angle: float) -> SoilReaction:
    """The load of `rows` is the component of the weight normal to the slope."""
    return replace(reaction, pull=reaction.pull - rows.load * math.tan(angle))


@mechanism("A", "load-transfer", "ratio", 0.1, "1", "force")
def _load_transfer(reaction: SoilReaction, rows: WheelState, ratio: float) -> SoilReaction:
    """The soil carries W + ratio DP where W is reported."""
    return replace(reaction, load=reaction.load - ratio * reaction.pull)


@mechanism("A", "bearing-friction", "coefficient", 0.01, "1", "reading")
def _bearing_friction(reaction: SoilReaction, rows: WheelState, coefficient: float) -> SoilReaction:
    return replace(reaction, torque=reaction.torque + coefficient * rows.load * rows.radius)


def _scaled(channel: str, reaction: SoilReaction, rows: WheelState, gain: float) -> SoilReaction:
    """A sensor whose readings are too large by a share."""
    return replace(reaction, **{channel: getattr(reaction, channel) * (1.0 + gain)})


def _shifted(channel: str, reaction: SoilReaction, rows: WheelState, offset: float) -> SoilReaction:
    """A sensor whose readings are too large by an offset."""
    return replace(reaction, **{channel: getattr(reaction, channel) + offset})


for _name, _channel, _offset, _unit in (
    ("torque", "torque", 0.1, "N m"),
    ("drawbar", "pull", 0.5, "N"),
    ("sinkage", "sinkage", 0.001, "m"),
):
    _gain = mechanism("S", f"{_name}-gain", "gain", 0.03, "1", "reading")
    _gain(partial(_scaled, _channel))
    _zero = mechanism("S", f"{_name}-offset", "offset", _offset, _unit, "reading")
    _zero(partial(_shifted, _channel))


@mechanism("S", "load-gain", "gain", 0.03, "1", "driven")
def _load_gain(rows: WheelState, gain: float) -> WheelState:
    return replace(rows, load=rows.load / (1.0 + gain))


@mechanism("S", "slip-scale", "scale", 0.015, "1", "driven")
def _slip_scale(rows: WheelState, scale: float) -> WheelState:
    """u' = u (1 + e), u the true travel ratio v / (r omega) and u' the reported one."""
    travel = rows.travel_ratio / (1.0 + scale)
    return replace(rows, slip=np.where(travel > 1.0, 1.0 / travel - 1.0, 1.0 - travel))
