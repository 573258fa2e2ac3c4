"""Geometry of a track's belt in the soil: an arc under each end wheel, and one between them."""

from __future__ import annotations

from dataclasses import dataclass

from soilml.arrays import Array, Real, namespace

#: The three arcs of the belt.
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
    trim: Array  # rad, psi, positive with the tail down
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


def height_above_front(belt: Belt, arc: int, inclination: Array) -> Array:
    """Height (m) of a point of the belt above the lowest point of the front wheel."""
    xp = namespace(inclination)
    sin_half_squared = xp.sin(0.5 * inclination) ** 2
    if arc == FRONT:
        return 2.0 * belt.radius * sin_half_squared
    if arc == MIDDLE:
        return middle_arc_top(belt) - 2.0 * belt.arc_radius * sin_half_squared
    return belt.sinkage - belt.rear + 2.0 * belt.radius * sin_half_squared


def middle_arc_top(belt: Belt) -> Array:
    """Height (m) of the top of the middle arc above the lowest point of the front wheel."""
    xp = namespace(belt.leave)
    return 2.0 * (belt.radius + belt.arc_radius) * xp.sin(0.5 * belt.leave) ** 2


def inclination_at_height(height: Array, radius: Real) -> Array:
    """Inclination (rad) of an arc where it is this far from its level point; 0 for no distance.

    The clipping keeps the derivative finite; larger inclinations are clipped again by the caller,
    to the end of the arc.
    """
    xp = namespace(height)
    sin_half_squared = xp.clip(height / (2.0 * radius), 1e-30, 0.99)
    return 2.0 * xp.asin(xp.sqrt(sin_half_squared))


def distance_along(belt: Belt, arc: int, inclination: Array) -> tuple[Array, Array]:
    """Distance (m) along the belt from where it enters the soil, and its horizontal projection."""
    xp = namespace(inclination)
    sin = xp.sin
    # distances at the start of the arc; inclination there, and whether it rises along the arc
    along = belt.radius * (belt.entry + belt.leave)
    horizontal = belt.radius * (sin(belt.entry) + sin(belt.leave))
    if arc == FRONT:
        along, horizontal = 0.0 * along, 0.0 * horizontal
        start, turn = belt.entry, -1.0
    elif arc == MIDDLE:
        start, turn = -belt.leave, 1.0
    else:
        along = along + belt.arc_radius * (belt.leave + belt.meet)
        horizontal = horizontal + belt.arc_radius * (sin(belt.leave) + sin(belt.meet))
        start, turn = belt.meet, -1.0
    radius = turn * arc_radius(belt, arc)
    return (
        along + radius * (inclination - start),
        horizontal + radius * (sin(inclination) - sin(start)),
    )
