"""The rigid wheel, by full integration of its stresses; a rim that lies flat along a chord."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

from soilml.arrays import Array, namespace
from soilml.numerics.quadrature import between, columns, crowded_start
from soilml.physics.contact import SMALLEST_DEPTH, Contact, Resolution
from soilml.physics.gears.rigid_wheel import (
    BrakingLaw,
    RigidWheel,
    WheelArc,
    contact_at,
    depth_at,
    differences_from_entry,
    displacement_direction,
    pressed_depth,
    reversals,
    sliced_contact,
)
from soilml.physics.operating_point import Operating

#: Nodes in each part of the contact of a driving and of a braking wheel. The accuracy of full
#: resolution over all inputs is tested against adaptive quadrature. In fits, forces differ from it
#: by 2e-5 of the load at most in driving rows, and in 99.9 % of braking rows.
NODES = {Resolution.FULL: (16, 24), Resolution.FIT: (9, 16), Resolution.COARSE: (5, 5)}
#: A nearly locked wheel mobilises the shear strength close to its entry. Where the travel ratio is
#: more than twice this number, a part of the contact ends at this number over the ratio, as a
#: fraction of the way to the maximum stress: errors at slips below -0.9 fall from 3e-5 to 4e-6.
MOBILISED_WITHIN = 5.0
SMALLEST_SLIP = 1e-12  # Slip of the chord below which shear there counts as not reversing
#: Nodes of a rim that lies flat, driving with five parts and braking with six. At full
#: resolution, against 48 nodes, forces differ by 2e-5 of the load at most in driving rows; in
#: braking rows by 1e-5 in 99 % of them, and by 3e-3 at most.
FLAT_RIM_NODES = {Resolution.FULL: (10, 12), Resolution.FIT: (8, 10), Resolution.COARSE: (3, 3)}


@final
@dataclass(frozen=True, kw_only=True)
class Wheel(RigidWheel):
    r"""A rigid cylinder: Bekker's pressure mirrored behind the angle of maximum stress.

    .. math::
        z(\theta) = r (\cos\theta - \cos\theta_1), \ \theta_m \le \theta \le \theta_1; \quad
        z(\theta) = r \left(\cos\left[\theta_1 - \frac{\theta - \theta_2}{\theta_m - \theta_2}
        (\theta_1 - \theta_m)\right] - \cos\theta_1\right), \ \theta_2 \le \theta < \theta_m

        j(\theta) = r [\theta_1 - \theta - (1 - s)(\sin\theta_1 - \sin\theta)]

    While the wheel brakes, the travel ratio v / (r omega) = 1 / (1 + s) replaces 1 - s, and shear
    stress has the sign of j. It points backward in front of the point where j is back at zero,
    forward behind it. Torque, pull and sinkage are continuous through zero slip, and a wheel that
    is towed without torque has a small negative slip. `braking="slip-sign"` is the law as the
    source papers print it: 1 - s at any slip, \|j\|, and the sign of the slip along the rim, so
    that the three jump at zero slip.

    References: Wong and Reece, J. Terramechanics 4(1), 1967; the same set in Nagatani et al. 2009,
    eqs. 3-10; the two directions of shear under a towed wheel, Wong and Reece, J. Terramechanics
    4(2), 1967. These let the displacement start anew at a transition angle, which follows from the
    direction of soil flow and exists for small skid only; here it is one integral from entry on.
    Holds for a rim that does not deform, straight travel, sinkage up to the hub, and
    wheels large against the soil's grains. Under the one wheel that Nagatani et al. measured, of
    0.11 m diameter, the stress is narrower and further forward (section IV).

    Examples
    --------
    >>> from soilml import Model, Operating, Wheel, soil
    >>> wheel = Wheel(radius=0.15, width=0.12)  # m
    >>> force = Model(wheel)(soil("wong1989/dry_sand"), Operating(slip=0.3, load=60.0))
    >>> f"{force.drawbar_pull:.2f} N at a sinkage of {1000 * force.sinkage:.1f} mm"
    '1.54 N at a sinkage of 16.3 mm'
    """

    name: ClassVar[str] = "wheel"

    def contact(
        self, geometry: WheelArc, at: Operating, resolution: Resolution = Resolution.FULL
    ) -> Contact:
        """The points along the arc; more of them where a braking wheel shears both ways."""
        if geometry.tilt is not None:
            return sliced_contact(geometry, lambda rim: self.contact(rim, at, resolution))
        brakes = bool(namespace(geometry.entry).any(at.slip < 0))
        if geometry.chord is not None:
            nodes = FLAT_RIM_NODES[resolution][int(brakes)]
            return flat_rim_contact(geometry, at, self.braking, nodes)
        driving, braking = NODES[resolution]
        if brakes and resolution is not Resolution.COARSE:
            inner = _braking_part_ends(geometry, 1.0 - geometry.travelled(at.slip, self.braking))
            angle, arc = between(geometry.exit, inner, geometry.entry, braking)
            depth = pressed_depth(geometry, angle)
            return contact_at(geometry, at, geometry.entry - angle, depth, arc, self.braking)
        return _two_part_contact(geometry, at, self.braking, driving)

    def profile_contact(
        self, geometry: WheelArc, at: Operating, points: int
    ) -> tuple[Array, Contact]:
        """Evenly spaced points from entry to exit, without area; of the middle of the width."""
        xp = namespace(geometry.entry)
        fraction = xp.linspace(0.0, 1.0, points, dtype=geometry.entry.dtype)[:, None]
        passed = fraction * (geometry.entry - geometry.exit)
        angle, none = geometry.entry - passed, xp.zeros_like(passed)
        if geometry.chord is not None:
            return angle, flat_rim_points(geometry, at, self.braking, angle, none)
        depth = pressed_depth(geometry, angle)
        return angle, contact_at(geometry, at, passed, depth, none, self.braking)


def _two_part_contact(rim: WheelArc, at: Operating, law: BrakingLaw, count: int) -> Contact:
    """Two parts, before and behind the maximum stress, nodes crowded where stress vanishes.

    The pressure behind the maximum mirrors that before it, at the same fractions of both parts.
    """
    xp = namespace(rim.entry)
    x, weight = columns(crowded_start(count), rim.entry)
    front, rear = rim.entry - rim.peak, rim.peak - rim.exit
    before = x * front
    depth = depth_at(rim, before)
    passed = xp.concat([before, (front + rear) - x * rear], axis=0)
    arc = xp.concat([weight * front, weight * rear], axis=0)
    return contact_at(rim, at, passed, xp.concat([depth, depth], axis=0), arc, law)


def _braking_part_ends(rim: WheelArc, slip: Array) -> list[Array]:
    """Angles (rad) between exit and entry that bound the parts of a braking wheel's contact.

    Parts end where shear displacement changes its direction and the shear curve bends: at the
    maximum stress and the reversal of shear displacement; a second
    reversal is added if any row has one, where the rim reaches far behind the axle. Rows
    without a reversal take an angle that divides the longer part, or the lowest, in halves, or one
    close to the entry where the wheel is nearly locked. `slip` is that of the shear displacement.
    """
    xp = namespace(rim.entry)
    front, rear = rim.entry - rim.peak, rim.peak - rim.exit
    reversal, exists = reversals(rim.entry, rim.exit, slip)
    halfway = xp.where(front > rear, rim.peak + 0.5 * front, rim.exit + 0.5 * rear)
    ratio = 1.0 - slip
    near_entry = rim.entry - front * (MOBILISED_WITHIN / ratio)
    halfway = xp.where(ratio > 2.0 * MOBILISED_WITHIN, near_entry, halfway)
    inner = [rim.peak, xp.where(exists[0, :], reversal[0, :], halfway)]
    if bool(xp.any(exists[1, :])):
        below = 0.5 * (rim.exit + xp.minimum(*inner))
        inner.append(xp.where(exists[1, :], reversal[1, :], below))
    return inner


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
