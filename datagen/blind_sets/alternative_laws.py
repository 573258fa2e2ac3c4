"""Mechanisms that textbooks describe, in other than their usual forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from datagen.blind_sets.catalogued import substitute_circle
from datagen.blind_sets.mechanism import Mechanism
from datagen.blind_sets.reference_wheel import ground_reaction, solve_equilibrium
from datagen.blind_sets.wheel_state import (
    ContactArc,
    ContactPoints,
    Floats,
    SoilReaction,
    WheelState,
)


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


def _square(rows: WheelState, n2: float) -> WheelState:
    return replace(rows, n=rows.n + n2 * rows.slip**2)


def _root_load(
    reaction: SoilReaction, arc: ContactArc, rows: WheelState, coefficient: float
) -> SoilReaction:
    return replace(reaction, pull=reaction.pull - coefficient * np.sqrt(rows.load))


def _depth_power(
    reaction: SoilReaction, arc: ContactArc, rows: WheelState, coefficient: float
) -> SoilReaction:
    return replace(reaction, pull=reaction.pull - coefficient * reaction.sinkage**1.5)


def _saturating_wheel(arc: ContactArc, rows: WheelState, most: float) -> ContactArc:
    return substitute_circle(arc, rows, most * -np.expm1(-rows.load / 60.0))


def _constant_exit(arc: ContactArc, rows: WheelState, angle: float) -> ContactArc:
    return replace(arc, exit=np.full_like(arc.exit, -angle))


def _proportional_exit(arc: ContactArc, rows: WheelState, share: float) -> ContactArc:
    return replace(arc, exit=-share * arc.entry)


def _saturating_grousers(arc: ContactArc, rows: WheelState, height: float) -> ContactArc:
    out = 0.75 * height * -np.expm1(-rows.slip / 0.15)
    return replace(arc, shear_radius=arc.shear_radius + out, lever=arc.lever + out)


def _growing_shift(arc: ContactArc, rows: WheelState, growth: float) -> ContactArc:
    shift = np.minimum(growth * rows.slip, 0.9)
    return replace(
        arc,
        peak=arc.peak + shift * (arc.entry - arc.peak),
        exit=arc.exit + shift * (arc.entry - arc.exit),
    )


def _rate_power(points: ContactPoints, arc: ContactArc, rows: WheelState, m: float) -> Floats:
    return np.asarray(points.shear * (rows.speed / 0.05) ** m)


def _along_velocity(
    points: ContactPoints, arc: ContactArc, rows: WheelState, share: float
) -> Floats:
    """Shear has the direction of the slip velocity at each point, not of the displacement."""
    aside = rows.travel_ratio * np.tan(rows.slip_angle) * share
    j = np.hypot(points.shear_displacement, arc.shear_radius * points.angle_from_entry * aside)
    along = 1.0 - rows.travel_ratio * np.cos(points.theta)
    tau = points.strength * -np.expm1(-j / rows.shear_modulus)
    return np.asarray(tau * along / np.hypot(along, aside))


def _saturating_passes(rows: WheelState, growth: float) -> WheelState:
    stiffer = 1.0 - growth * np.expm1(-(rows.pass_number - 1.0) / 1.5)
    return replace(rows, kc=rows.kc * stiffer, kphi=rows.kphi * stiffer)


ALTERNATIVE_FORMS = (
    Mechanism(
        name="slip-sinkage", form="lyasko", size="share", reference=1.0, unit="1", soil=_lyasko
    ),
    Mechanism(name="slip-sinkage", form="square", size="n2", reference=0.8, unit="1", soil=_square),
    Mechanism(
        name="bulldozing",
        form="root-load",
        size="coefficient",
        reference=0.8,
        unit="N^0.5",
        force=_root_load,
    ),
    Mechanism(
        name="bulldozing",
        form="depth-power",
        size="coefficient",
        reference=3000.0,
        unit="N/m^1.5",
        force=_depth_power,
    ),
    Mechanism(
        name="wheel-flexibility",
        form="saturating",
        size="delta_max",
        reference=0.003,
        unit="m",
        arc=_saturating_wheel,
    ),
    Mechanism(
        name="exit-angle",
        form="constant",
        size="b",
        reference=0.15,
        unit="rad",
        arc=_constant_exit,
    ),
    Mechanism(
        name="exit-angle",
        form="proportional",
        size="b0",
        reference=0.3,
        unit="1",
        arc=_proportional_exit,
    ),
    Mechanism(
        name="grousers",
        form="saturating",
        size="height",
        reference=0.012,
        unit="m",
        arc=_saturating_grousers,
    ),
    Mechanism(
        name="stress-shift",
        form="with-slip",
        size="growth",
        reference=0.5,
        unit="1",
        arc=_growing_shift,
    ),
    Mechanism(
        name="rate",
        form="power",
        size="m",
        reference=0.06,
        unit="1",
        shear=_rate_power,
        needs="speed",
    ),
    Mechanism(
        name="multipass",
        form="saturating",
        size="growth",
        reference=0.8,
        unit="1",
        soil=_saturating_passes,
        needs="pass_number",
    ),
    Mechanism(
        name="lateral-slip",
        form="velocity",
        size="share",
        reference=1.0,
        unit="1",
        shear=_along_velocity,
        needs="slip_angle",
    ),
)
