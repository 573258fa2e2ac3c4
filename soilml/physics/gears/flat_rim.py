"""The contact of a rim that lies flat on the soil along a chord between two arcs."""

from __future__ import annotations

from soilml.arrays import Array, namespace
from soilml.numerics.quadrature import between
from soilml.physics.contact import SMALLEST_DEPTH, Contact
from soilml.physics.gears.rigid_wheel import (
    BrakingLaw,
    WheelArc,
    differences_from_entry,
    displacement_direction,
    reversals,
)
from soilml.physics.operating_point import Operating

SMALLEST_SLIP = 1e-12  # Slip of the chord below which shear there counts as not reversing


def flat_rim_contact(rim: WheelArc, at: Operating, law: BrakingLaw, count: int) -> Contact:
    """Points of a rim with a chord, `count` of them in each part.

    Parts end at the chord, where pressure begins to fall, and where shear displacement reverses.
    """
    angle, arc = between(rim.exit, _part_ends(rim, at, law), rim.entry, count)
    return flat_rim_points(rim, at, law, angle, arc)


def _part_ends(rim: WheelArc, at: Operating, law: BrakingLaw) -> list[Array]:
    """Angles (rad) within the contact between which all is smooth that is integrated, (batch,)."""
    xp = namespace(rim.entry)
    chord = rim.chord + 0.0 * rim.entry
    fall = (rim.entry - chord) / (rim.entry - rim.peak)
    inner = [
        rim.peak,
        xp.maximum(-chord, rim.exit),
        xp.minimum(chord, rim.entry),
        rim.exit + xp.minimum(fall, xp.ones_like(fall)) * (rim.peak - rim.exit),
    ]
    if bool(xp.any(at.slip < 0)):
        travelled = rim.travelled(at.slip, law)
        on_arc, exists = reversals(rim.entry, chord, 1.0 - travelled)
        edge = xp.sin(chord)
        sheared = rim.entry - chord - travelled * (xp.sin(rim.entry) - edge)
        rate = xp.maximum(travelled - 1.0, xp.full_like(travelled, SMALLEST_SLIP))
        on_chord = xp.atan((edge - sheared / rate) / xp.cos(chord))
        reversal = xp.where(exists[0, :], on_arc[0, :], on_chord)
        inner.append(xp.minimum(xp.maximum(reversal, rim.exit), rim.entry))
    return inner


def flat_rim_points(
    rim: WheelArc, at: Operating, law: BrakingLaw, angle: Array, arc: Array
) -> Contact:
    r"""Contact at these angles (rad) about the axle, each of `arc` (rad); (points, batch).

    .. math::
        z = \min[r (\cos\theta - \cos\theta_1), z_0], \quad
        dj = [1 - (1 - s) \cos\alpha] ds

    with alpha the inclination of the rim, 0 on the chord, which stands r cos(theta_c) below the
    axle. Behind the maximum the pressure is that at the mirrored angle before it.
    """
    xp = namespace(angle)
    chord, radius = rim.chord + 0.0 * rim.entry, rim.radius
    sin_chord, cos_chord = xp.sin(chord), xp.cos(chord)
    height = radius * cos_chord
    sine, cosine, none = xp.sin(angle), xp.cos(angle), xp.zeros_like(angle)
    before, behind = angle >= chord, angle <= -chord  # the points on both arcs
    flat = ~(before | behind)
    passed = rim.entry - xp.where(before, angle, chord + none)
    sin_difference, _ = differences_from_entry(xp.sin(rim.entry), xp.cos(rim.entry), passed)
    edge = xp.where(before, sin_chord + none, -sin_chord + none)
    across = xp.where(flat, sine / cosine, edge / cos_chord)  # tangent of the angle on the chord
    on_chord = radius * sin_chord - height * across
    along = radius * (passed - xp.where(behind, chord + angle, none)) + on_chord
    horizontal = sin_difference - xp.where(behind, sin_chord + sine, none)
    horizontal = radius * horizontal + on_chord
    travelled = rim.travelled(at.slip, law)
    displacement = rim.shear_radius / radius * (along - travelled * horizontal)
    mirrored = rim.entry - (angle - rim.exit) * ((rim.entry - rim.peak) / (rim.peak - rim.exit))
    higher = xp.maximum(xp.where(angle < rim.peak, mirrored, angle), chord)
    depth = xp.sin(0.5 * (rim.entry - higher)) * xp.sin(0.5 * (rim.entry + higher))
    depth = 2.0 * radius * depth
    area = rim.width * arc * xp.where(flat, height / cosine**2, radius + none)
    return Contact(
        depth=xp.maximum(depth, xp.full_like(depth, SMALLEST_DEPTH)),
        shear_displacement=displacement,
        surface_travel=rim.shear_radius * (rim.entry - angle),
        area=area,
        horizontal_area=area * xp.where(flat, xp.ones_like(angle), cosine),
        frontal_area=area * xp.where(flat, none, sine),
        shear_lever_arm=rim.lever - xp.where(flat, radius - height, none),
        width=rim.width,
        normal_lever_arm=xp.where(flat, height * across, none),
        shear_direction=displacement_direction(displacement, at.slip, law),
        travel_ratio=travelled,
        geometry=rim,
    )
