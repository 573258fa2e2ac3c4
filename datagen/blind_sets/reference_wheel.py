"""A rigid wheel in soil, with causes acting on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from datagen.blind_sets.mechanism import Acting
from datagen.blind_sets.wheel_state import Arc, Floats, Points, Push, Rows

NODES = 40
#: Depths looked at for the first that carries the load, and halvings between two of them.
LOOKS, HALVINGS = 40, 46


def _crowded() -> tuple[Floats, Floats]:
    """Gauss-Legendre nodes and weights on 0 to 1 in t, with x = t^2: dense where stress begins."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    t = 0.5 * (x + 1.0)
    return (t * t)[:, None], (w * t)[:, None]


NODE, WEIGHT = _crowded()


def settled(rows: Rows, acting: Acting = ()) -> Push:
    """What the sensors report of a wheel at rest under its load; arrays (n,), SI.

    The wheel stands at the first sinkage at which the soil carries the load, searched from the
    surface to the hub and then halved. NaN where there is none. Sources: Wong and Reece,
    J. Terramechanics 4(1), 1967, for the wheel; causes bring their own.
    """
    for cause, size in acting:
        rows = rows if cause.driven is None else cause.driven(rows, size)
    for cause, size in acting:
        rows = rows if cause.soil is None else cause.soil(rows, size)
    push = _at_rest(rows, acting)
    for cause, size in acting:
        push = push if cause.reading is None else cause.reading(push, rows, size)
    return push


def pushed(depth_angle: Floats, rows: Rows, acting: Acting = ()) -> Push:
    r"""Forces at a given sinkage, whatever load that carries; arrays (n,).

    .. math::
        z = r (1 - \cos x), \quad
        \sigma = (k_c / b + k_\varphi) \delta^n, \quad
        \tau = (c + \sigma \tan\varphi) (1 - e^{-j / K}), \quad
        j = r [\theta_1 - \theta - (1 - s)(\sin\theta_1 - \sin\theta)]

    x is `depth_angle`, the entry angle (rad) of a rim that does not deform; the depth delta is
    mirrored behind the angle of maximum stress. For slip above zero. Source: Wong and Reece 1967.
    """
    arc = _arc(depth_angle, rows, acting)
    front, rear = arc.entry - arc.peak, arc.peak - arc.exit
    passed = np.concatenate([NODE * front, front + (1.0 - NODE) * rear])
    mapped = np.concatenate([NODE * front, NODE * front])
    span = np.concatenate([WEIGHT * front, WEIGHT * rear])
    theta = arc.entry - passed
    points = _points(theta, passed, mapped, arc, rows, acting)
    area = arc.radius * rows.width * span
    sin, cos = np.sin(theta), np.cos(theta)
    push = Push(
        load=np.sum((points.normal * cos + points.shear * sin) * area, axis=0),
        pull=np.sum((points.shear * cos - points.normal * sin) * area, axis=0),
        torque=np.sum(points.shear * arc.lever * area, axis=0),
        sinkage=arc.sinkage,
    )
    for cause, size in acting:
        push = push if cause.force is None else cause.force(push, arc, rows, size)
    inside = (arc.exit < arc.peak) & (arc.peak < arc.entry)
    return replace(push, load=np.where(inside, push.load, np.nan))


def _arc(depth_angle: Floats, rows: Rows, acting: Acting) -> Arc:
    arc = Arc(
        entry=depth_angle,
        exit=np.zeros_like(depth_angle),
        peak=(rows.a0 + rows.a1 * rows.slip) * depth_angle,
        sinkage=2.0 * rows.radius * np.sin(0.5 * depth_angle) ** 2,
        radius=rows.radius,
        shear_radius=rows.radius,
        lever=rows.radius,
    )
    for cause, size in acting:
        arc = arc if cause.arc is None else cause.arc(arc, rows, size)
    return arc


def _points(
    theta: Floats, passed: Floats, mapped: Floats, arc: Arc, rows: Rows, acting: Acting
) -> Points:
    depth = _fallen(arc.entry - mapped, mapped, arc.entry) * arc.radius
    normal = (rows.kc / rows.width + rows.kphi) * depth**rows.n
    for cause, size in acting:
        if cause.pressure is not None:
            normal = cause.pressure(normal, depth, rows, size)
    strength = rows.cohesion + normal * np.tan(rows.friction_angle)
    climbed = 2.0 * np.cos(0.5 * (arc.entry + theta)) * np.sin(0.5 * passed)
    sheared = arc.shear_radius * (passed - (1.0 - rows.slip) * climbed)
    shear = strength * -np.expm1(-sheared / rows.shear_modulus)
    points = Points(theta, passed, depth, sheared, normal, strength, shear)
    for cause, size in acting:
        if cause.shear is not None:
            points = replace(points, shear=cause.shear(points, arc, rows, size))
    return points


def _fallen(theta: Floats, gone: Floats, entry: Floats) -> Floats:
    """cos(theta) - cos(theta_1), as a product that keeps its digits."""
    return np.asarray(2.0 * np.sin(0.5 * (entry + theta)) * np.sin(0.5 * gone))


def _at_rest(rows: Rows, acting: Acting) -> Push:
    """Forces at the first sinkage at which the load is carried."""
    with np.errstate(all="ignore"):
        looks = 0.5 * np.pi * (np.arange(1, LOOKS + 1) / LOOKS) ** 1.5
        carries = np.stack(
            [pushed(np.full_like(rows.load, x), rows, acting).load >= rows.load for x in looks]
        )
        first = np.argmax(carries, axis=0)
        high = looks[first]
        low = np.where(first > 0, looks[np.maximum(first - 1, 0)], 0.0)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            enough = pushed(middle, rows, acting).load >= rows.load
            low, high = np.where(enough, low, middle), np.where(enough, middle, high)
        push = pushed(0.5 * (low + high), rows, acting)
    ok = carries.any(axis=0) & (np.abs(push.load / rows.load - 1.0) < 1e-8)
    return Push(
        load=np.where(ok, push.load, np.nan),
        pull=np.where(ok, push.pull, np.nan),
        torque=np.where(ok, push.torque, np.nan),
        sinkage=np.where(ok, push.sinkage, np.nan),
    )
