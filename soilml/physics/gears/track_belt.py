"""A track's belt in the soil: its arcs, the points along it, and the soil unloaded beneath it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from soilml.arrays import Array, Real, namespace
from soilml.numerics.quadrature import columns, crowded_ends, crowded_start, gauss
from soilml.physics.contact import SMALLEST_DEPTH, Contact
from soilml.physics.operating_point import Operating

#: Fraction of the peak pressure over which the shear of unloading soil fades out.
FADING_PRESSURE = 0.05


@dataclass(frozen=True)
class Belt:
    """Inclinations where the arcs of a track meet, their radii and depths; arrays (batch,).

    The inclination is that of the belt against the ground, positive where it leads down backwards.
    It falls from `entry` to -`leave` around the front wheel and rises to `meet` along the middle
    arc, which bulges upwards. Around the rear wheel it falls to -`exit`.
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


@dataclass(frozen=True)
class Arc:
    """One of the three arcs of the belt, on the way from where it enters the soil."""

    radius: Real  # m
    turn: float  # 1 where the inclination rises along the arc, -1 where it falls
    start: Array  # rad, inclination where the arc begins
    along: Real  # m, distance along the belt to where it begins
    horizontal: Real  # m, horizontal projection of that distance
    level: Real  # m, height of its level point above the lowest point of the front wheel
    lowest: Array  # m, depth from which the soil behind its level point was unloaded

    def height(self, inclination: Array) -> Array:
        """Height (m) of a point above the lowest point of the front wheel."""
        rise = 2.0 * self.radius * namespace(inclination).sin(0.5 * inclination) ** 2
        return self.level - self.turn * rise

    def distance(self, inclination: Array) -> tuple[Array, Array]:
        """Distance (m) along the belt from where it enters the soil, and its projection."""
        sin, radius = namespace(inclination).sin, self.turn * self.radius
        turned = sin(inclination) - sin(self.start)
        along = self.along + radius * (inclination - self.start)
        return along, self.horizontal + radius * turned


def belt_arcs(belt: Belt) -> tuple[Arc, Arc, Arc]:
    """The arcs around the front wheel, between the wheels and around the rear one."""
    sin = namespace(belt.entry).sin
    along = belt.radius * (belt.entry + belt.leave)
    horizontal = belt.radius * (sin(belt.entry) + sin(belt.leave))
    rear_along = along + belt.arc_radius * (belt.leave + belt.meet)
    rear_horizontal = horizontal + belt.arc_radius * (sin(belt.leave) + sin(belt.meet))
    higher, top = (
        belt.sinkage - belt.rear,
        2.0 * (belt.radius + belt.arc_radius) * sin(0.5 * belt.leave) ** 2,
    )
    return (
        Arc(belt.radius, -1.0, belt.entry, 0.0, 0.0, 0.0, belt.sinkage),
        Arc(belt.arc_radius, 1.0, -belt.leave, along, horizontal, top, belt.sinkage),
        Arc(belt.radius, -1.0, belt.meet, rear_along, rear_horizontal, higher, belt.rear),
    )


def inclination_at_height(height: Array, radius: Real) -> Array:
    """Inclination (rad) of an arc where it is this far from its level point; 0 for no distance.

    The clipping keeps the derivative finite; larger inclinations are clipped again by the caller,
    to the end of the arc.
    """
    xp = namespace(height)
    sin_half_squared = xp.clip(height / (2.0 * radius), 1e-30, 0.99)
    return 2.0 * xp.asin(xp.sqrt(sin_half_squared))


def equivalent_depth(belt: Belt, deepest: Array, height: Array) -> Array:
    r"""Depth (m) at which virgin soil has the pressure of soil unloaded by `height`.

    .. math::
        \sigma = k z_u^n - k_u (z_u - z) = k z_e^n, \quad k_u = \frac{k z_u^{n-1}}{\rho}, \quad
        z_e = z_u \left(1 - \frac{z_u - z}{\rho z_u}\right)^{1/n}

    `deepest` is z_u, the depth (m) to which the soil was loaded, and `height` is z_u - z (m).
    References: Wang et al. 2018, eq. 1, unloading and reloading along one line.
    """
    xp = namespace(height)
    pressure = 1.0 - height / (belt.rebound * deepest)  # as a fraction of the largest
    positive = xp.maximum(pressure, xp.full_like(pressure, SMALLEST_DEPTH))
    return deepest * xp.exp(xp.log(positive) / belt.n)


def shear_retention(belt: Belt, deepest: Array, height: Array) -> Array:
    r"""Fraction of the shear displacement that soil unloaded by `height` (m) retains.

    .. math:: 1 - e^{-\sigma / (0.05 \sigma_u)}

    It is 1 except in the last few per cent of the pressure, and 0 where the belt does not touch.
    Otherwise cohesion would end abruptly, and the pull would have no derivative where the belt
    lifts off. The form is ours.
    """
    xp = namespace(height)
    pressure = 1.0 - height / (belt.rebound * deepest)  # as a fraction of the largest
    return -xp.expm1(-xp.maximum(pressure, xp.zeros_like(pressure)) / FADING_PRESSURE)


def belt_contact(belt: Belt, at: Operating, entry: int, between: int, short: int) -> Contact:
    """The points along the belt where it touches, by numbers of nodes.

    Eight segments end where the soil is unloaded, reloaded or released, or loaded deeper than
    before: on each of them the pressure follows one law.
    """
    xp = namespace(belt.entry)
    front, middle, rear = belt_arcs(belt)
    level = xp.zeros_like(belt.entry)
    first, second = belt.sinkage, belt.rear
    further = second - first
    # soil unloaded from the depth `first` has no pressure left at the height rebound * first;
    # behind the front wheel:
    released = xp.minimum(inclination_at_height(belt.rebound * first, belt.radius), belt.leave)
    # on both sides of the top of the middle arc, whose inclination is counted from there:
    off_ground = inclination_at_height(middle.level - belt.rebound * first, belt.arc_radius)
    off, on = xp.minimum(off_ground, belt.leave), xp.minimum(off_ground, belt.meet)
    # behind the top, where the belt comes back to the depth `first`:
    deeper = xp.minimum(inclination_at_height(middle.level, belt.arc_radius), belt.meet)
    deeper = xp.maximum(deeper, on)
    # in front of the rear wheel, where it meets the rebounded soil, and the depth `first`:
    met = inclination_at_height(further + belt.rebound * first, belt.radius)
    met = xp.minimum(met, belt.meet)
    rear_deeper = xp.minimum(inclination_at_height(further, belt.radius), met)
    # behind the rear wheel, unloaded from the depth `second`:
    out = xp.minimum(inclination_at_height(belt.rebound * second, belt.radius), belt.exit)
    segments = (
        (front, belt.entry, level, crowded_start(entry)),
        (front, level, -released, gauss(short)),
        (middle, -belt.leave, -off, crowded_ends(between)),
        (middle, on, deeper, crowded_ends(between)),
        (middle, deeper, belt.meet, gauss(short)),
        (rear, met, rear_deeper, gauss(short)),
        (rear, rear_deeper, level, gauss(short)),
        (rear, level, -out, gauss(short)),
    )
    parts = []
    for arc, start, end, nodes in segments:
        x, weight = columns(nodes, belt.entry)
        area = belt.width * arc.radius * xp.abs(end - start) * weight
        parts.append(_belt_points(belt, at, arc, start + (end - start) * x, area))
    by_point = (
        *("depth", "shear_displacement", "surface_travel"),
        *("area", "horizontal_area", "frontal_area"),
    )
    joined = {name: xp.concat([getattr(p, name) for p in parts], axis=0) for name in by_point}
    return replace(parts[0], **joined)


def _belt_points(belt: Belt, at: Operating, arc: Arc, inclination: Array, area: Array) -> Contact:
    """Points of one arc at inclinations (rad), each of an area (m^2); arrays (points, batch).

    A point presses the soil deeper than ever, or rests on soil that was unloaded from the depth of
    the front wheel, behind the lowest point of the rear wheel from that one's.
    """
    xp = namespace(inclination)
    height = arc.height(inclination)
    along, horizontal = arc.distance(inclination)
    behind = inclination < 0.0
    depth = belt.sinkage - height
    deepest = xp.where(behind, arc.lowest + 0.0 * height, belt.sinkage + 0.0 * height)
    virgin = depth > deepest
    unloaded_by = deepest - depth
    if arc.start is belt.entry:  # as a product: near there a difference would lose its digits
        both = 0.5 * (belt.entry - inclination), 0.5 * (belt.entry + inclination)
        depth = 2.0 * belt.radius * xp.sin(both[0]) * xp.sin(both[1])
        virgin = ~behind
    pressed = xp.where(virgin, depth, equivalent_depth(belt, deepest, unloaded_by))
    sheared = along - (1.0 - at.slip) * horizontal
    retained = sheared * shear_retention(belt, deepest, unloaded_by)
    return Contact(
        depth=xp.maximum(pressed, xp.full_like(pressed, SMALLEST_DEPTH)),
        shear_displacement=xp.where(virgin, sheared, retained),
        surface_travel=along,
        area=area,
        horizontal_area=area * xp.cos(inclination),
        frontal_area=area * xp.sin(inclination),
        shear_lever_arm=belt.radius,
        width=belt.width,
    )


def belt_profile(belt: Belt, at: Operating, points: int) -> tuple[Array, Contact]:
    """Inclinations (rad) of evenly spaced points from entry to exit, and their contact."""
    xp = namespace(belt.entry)
    fraction = xp.linspace(0.0, 1.0, points, dtype=belt.entry.dtype)[:, None]
    arcs = belt_arcs(belt)
    _, middle, rear = arcs
    along = fraction * rear.distance(-belt.exit)[0]
    # inclination that the point would have on each of the three arcs
    angles = [arc.start + arc.turn * (along - arc.along) / arc.radius for arc in arcs]
    none = xp.zeros_like(along)
    parts = [
        _belt_points(belt, at, arc, angle, none) for arc, angle in zip(arcs, angles, strict=True)
    ]

    def of_its_arc(values: list[Array]) -> Array:
        front, between, last = values
        return xp.where(along < middle.along, front, xp.where(along < rear.along, between, last))

    return of_its_arc(angles), replace(
        parts[0],
        depth=of_its_arc([part.depth for part in parts]),
        shear_displacement=of_its_arc([part.shear_displacement for part in parts]),
        surface_travel=along,
    )
