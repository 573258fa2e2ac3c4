"""The line that a track takes in the soil: an arc under each end wheel, and one between them."""

from __future__ import annotations

from dataclasses import dataclass

from soilml.arrays import Array, Real, namespace
from soilml.numerics.quadrature import Nodes, columns
from soilml.physics.contact import Contact
from soilml.physics.gears.rigid_wheel import NO_DEPTH
from soilml.physics.operating_point import Operating

#: Share of the peak pressure about which unloaded soil lets go of the belt (see `held`).
LETTING_GO = 0.05
#: The three arcs of the line.
FRONT, MIDDLE, REAR = range(3)


@dataclass(frozen=True)
class Belt:
    """Inclinations where the arcs of a track meet, their radii and depths; arrays (batch,).

    The inclination is that of the belt against the ground, positive where it leads down backwards:
    it falls from `entry` to -`leave` around the front wheel, rises to `meet` along the middle arc,
    which bulges upwards, and falls to -`exit` around the rear wheel.
    """

    entry: Array  # rad, theta_11
    leave: Array  # rad, theta_12, where the belt leaves the front wheel
    meet: Array  # rad, theta_21, where it meets the rear wheel
    exit: Array  # rad, theta_22
    trim: Array  # rad, psi, the robot's tail down
    sinkage: Array  # m, z_1, lowest point of the front wheel
    rear: Array  # m, z_2, lowest point of the rear wheel
    arc_radius: Array  # m, R_t, radius of the middle arc
    radius: Real  # m, r, radius of the end wheels with the belt
    width: Real  # m
    rebound: Real  # 1, share of the deepest sinkage that the soil springs back when unloaded
    n: Real  # 1, exponent of sinkage of the soil


def arc_radius(belt: Belt, arc: int) -> Real:
    """Radius (m) of one of the three arcs."""
    return belt.arc_radius if arc == MIDDLE else belt.radius


def raised(belt: Belt, arc: int, inclination: Array) -> Array:
    """Height (m) of a point of the belt above the lowest point of the front wheel."""
    xp = namespace(inclination)
    square = xp.sin(0.5 * inclination) ** 2
    if arc == FRONT:
        return 2.0 * belt.radius * square
    if arc == MIDDLE:
        return top(belt) - 2.0 * belt.arc_radius * square
    return belt.sinkage - belt.rear + 2.0 * belt.radius * square


def top(belt: Belt) -> Array:
    """Height (m) of the top of the middle arc above the lowest point of the front wheel."""
    xp = namespace(belt.leave)
    return 2.0 * (belt.radius + belt.arc_radius) * xp.sin(0.5 * belt.leave) ** 2


def gone(belt: Belt, arc: int, inclination: Array) -> tuple[Array, Array]:
    """Way (m) along the belt from where it enters the soil, and its projection on the ground."""
    xp = namespace(inclination)
    sin = xp.sin
    along = belt.radius * (belt.entry + belt.leave)
    ahead = belt.radius * (sin(belt.entry) + sin(belt.leave))
    if arc == FRONT:
        along, ahead = 0.0 * along, 0.0 * ahead
        before, turn = belt.entry, -1.0
    elif arc == MIDDLE:
        before, turn = -belt.leave, 1.0
    else:
        along = along + belt.arc_radius * (belt.leave + belt.meet)
        ahead = ahead + belt.arc_radius * (sin(belt.leave) + sin(belt.meet))
        before, turn = belt.meet, -1.0
    radius = turn * arc_radius(belt, arc)
    return (
        along + radius * (inclination - before),
        ahead + radius * (sin(inclination) - sin(before)),
    )


def sprung(belt: Belt, deepest: Array, height: Array) -> Array:
    r"""Depth (m) that has the pressure of soil unloaded, or loaded again, this far above `deepest`.

    .. math::
        \sigma = k z_u^n - k_u (z_u - z) = k z_e^n, \quad k_u = \frac{k z_u^{n-1}}{\rho}, \quad
        z_e = z_u \left(1 - \frac{z_u - z}{\rho z_u}\right)^{1/n}

    References: Wang et al. 2018, eq. 1, unloading and reloading along one line.
    """
    xp = namespace(height)
    share = 1.0 - height / (belt.rebound * deepest)
    return deepest * xp.exp(xp.log(xp.maximum(share, xp.full_like(share, NO_DEPTH))) / belt.n)


def held(belt: Belt, deepest: Array, height: Array) -> Array:
    r"""Share of the shear displacement that soil unloaded by this height still has.

    .. math:: 1 - e^{-\sigma / (0.05 \sigma_u)}

    1 but for the last few per cent of the pressure, 0 where the belt does not touch: without it
    cohesion would end all at once there, and the pull would have no derivative where the belt is
    about to lift off. Ours.
    """
    xp = namespace(height)
    share = 1.0 - height / (belt.rebound * deepest)
    return -xp.expm1(-xp.maximum(share, xp.zeros_like(share)) / LETTING_GO)


def stretch(
    belt: Belt,
    at: Operating,
    arc: int,
    ends: tuple[Array, Array],
    deepest: Array | None,
    nodes: Nodes,
) -> Contact:
    """Points of a stretch of belt between two inclinations (rad) on one arc.

    `deepest` (m) is the sinkage to which the soil under it was loaded before, None where it meets
    soil that was never loaded so much.
    """
    xp = namespace(belt.entry)
    x, weight = columns(nodes, belt.entry)
    start, end = ends
    inclination = start + (end - start) * x
    height = raised(belt, arc, inclination)
    along, ahead = gone(belt, arc, inclination)
    sheared = along - (1.0 - at.slip) * ahead
    if deepest is not None:
        risen = height - (belt.sinkage - deepest)
        depth = sprung(belt, deepest, risen)
        sheared = sheared * held(belt, deepest, risen)
    elif arc == FRONT:  # as a product: near the entry a difference would lose its digits
        sin_half = xp.sin(0.5 * (belt.entry - inclination)) * xp.sin(
            0.5 * (belt.entry + inclination)
        )
        depth = 2.0 * belt.radius * sin_half
    else:
        depth = belt.sinkage - height
    area = belt.width * arc_radius(belt, arc) * xp.abs(end - start) * weight
    return Contact(
        depth=xp.maximum(depth, xp.full_like(depth, NO_DEPTH)),
        sheared=sheared,
        rolled=along,
        area=area,
        up=area * xp.cos(inclination),
        ahead=area * xp.sin(inclination),
        lever=belt.radius,
        width=belt.width,
    )
