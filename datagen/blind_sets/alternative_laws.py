"""Causes that textbooks know, in other forms than the usual one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from datagen.blind_sets.catalogued import substitute_circle
from datagen.blind_sets.mechanism import Cause
from datagen.blind_sets.reference_wheel import pushed, settled
from datagen.blind_sets.wheel_state import Arc, Floats, Points, Push, Rows


def _lyasko(rows: Rows, share: float) -> Rows:
    """z = z0 (1 + s) / (1 - s / 2): soil softened so far that the wheel stands that deep.

    At a given sinkage the load is linear in the modulus, so two evaluations tell how far.
    """
    grown = (1.0 + rows.slip) / (1.0 - 0.5 * rows.slip)
    z = settled(rows).sinkage * (1.0 + share * (grown - 1.0))
    with np.errstate(invalid="ignore"):
        x = 2.0 * np.arcsin(np.sqrt(z / (2.0 * rows.radius)))
    whole = pushed(x, rows).load
    none = np.zeros_like(rows.kc)
    bare = pushed(x, replace(rows, kc=none, kphi=none)).load
    left = (rows.load - bare) / (whole - bare)
    left = np.where(left > 0.0, left, np.nan)
    return replace(rows, kc=rows.kc * left, kphi=rows.kphi * left)


def _square(rows: Rows, n2: float) -> Rows:
    return replace(rows, n=rows.n + n2 * rows.slip**2)


def _root_load(push: Push, arc: Arc, rows: Rows, coefficient: float) -> Push:
    return replace(push, pull=push.pull - coefficient * np.sqrt(rows.load))


def _depth_power(push: Push, arc: Arc, rows: Rows, coefficient: float) -> Push:
    return replace(push, pull=push.pull - coefficient * push.sinkage**1.5)


def _saturating_wheel(arc: Arc, rows: Rows, most: float) -> Arc:
    return substitute_circle(arc, rows, most * -np.expm1(-rows.load / 60.0))


def _constant_exit(arc: Arc, rows: Rows, angle: float) -> Arc:
    return replace(arc, exit=np.full_like(arc.exit, -angle))


def _proportional_exit(arc: Arc, rows: Rows, share: float) -> Arc:
    return replace(arc, exit=-share * arc.entry)


def _saturating_grousers(arc: Arc, rows: Rows, height: float) -> Arc:
    out = 0.75 * height * -np.expm1(-rows.slip / 0.15)
    return replace(arc, shear_radius=arc.shear_radius + out, lever=arc.lever + out)


def _growing_shift(arc: Arc, rows: Rows, growth: float) -> Arc:
    shift = np.minimum(growth * rows.slip, 0.9)
    return replace(
        arc,
        peak=arc.peak + shift * (arc.entry - arc.peak),
        exit=arc.exit + shift * (arc.entry - arc.exit),
    )


def _rate_power(points: Points, arc: Arc, rows: Rows, m: float) -> Floats:
    return np.asarray(points.shear * (rows.speed / 0.05) ** m)


def _along_velocity(points: Points, arc: Arc, rows: Rows, share: float) -> Floats:
    """Shear points along the velocity of slip at each point, not along the displacement."""
    aside = (1.0 - rows.slip) * np.tan(rows.slip_angle) * share
    j = np.hypot(points.sheared, arc.shear_radius * points.gone * aside)
    along = 1.0 - (1.0 - rows.slip) * np.cos(points.theta)
    tau = points.strength * -np.expm1(-j / rows.shear_modulus)
    return np.asarray(tau * along / np.hypot(along, aside))


def _saturating_passes(rows: Rows, growth: float) -> Rows:
    stiffer = 1.0 - growth * np.expm1(-(rows.pass_number - 1.0) / 1.5)
    return replace(rows, kc=rows.kc * stiffer, kphi=rows.kphi * stiffer)


FORMS = (
    Cause(name="slip-sinkage", form="lyasko", size="share", reference=1.0, unit="1", soil=_lyasko),
    Cause(name="slip-sinkage", form="square", size="n2", reference=0.8, unit="1", soil=_square),
    Cause(
        name="bulldozing",
        form="root-load",
        size="coefficient",
        reference=0.8,
        unit="N^0.5",
        force=_root_load,
    ),
    Cause(
        name="bulldozing",
        form="depth-power",
        size="coefficient",
        reference=3000.0,
        unit="N/m^1.5",
        force=_depth_power,
    ),
    Cause(
        name="wheel-flexibility",
        form="saturating",
        size="delta_max",
        reference=0.003,
        unit="m",
        arc=_saturating_wheel,
    ),
    Cause(
        name="exit-angle",
        form="constant",
        size="b",
        reference=0.15,
        unit="rad",
        arc=_constant_exit,
    ),
    Cause(
        name="exit-angle",
        form="proportional",
        size="b0",
        reference=0.3,
        unit="1",
        arc=_proportional_exit,
    ),
    Cause(
        name="grousers",
        form="saturating",
        size="height",
        reference=0.012,
        unit="m",
        arc=_saturating_grousers,
    ),
    Cause(
        name="stress-shift",
        form="with-slip",
        size="growth",
        reference=0.5,
        unit="1",
        arc=_growing_shift,
    ),
    Cause(
        name="rate",
        form="power",
        size="m",
        reference=0.06,
        unit="1",
        shear=_rate_power,
        needs="speed",
    ),
    Cause(
        name="multipass",
        form="saturating",
        size="growth",
        reference=0.8,
        unit="1",
        soil=_saturating_passes,
        needs="pass_number",
    ),
    Cause(
        name="lateral-slip",
        form="velocity",
        size="share",
        reference=1.0,
        unit="1",
        shear=_along_velocity,
        needs="slip_angle",
    ),
)
