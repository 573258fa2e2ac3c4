"""The arc of a circle in the soil, the shear displacement along it, and the rigid wheel.

Differences of angles keep their digits at small sinkage. The laws of braking say how the shear
displacement is found while the gear brakes, and which sign the shear stress has.
"""

from __future__ import annotations

import math
from abc import ABC
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, final, get_args

from soilml.arrays import Array, Real, namespace
from soilml.errors import InputError
from soilml.parameters import Parameter
from soilml.physics.contact import SMALLEST_DEPTH, Contact
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil
from soilml.row_status import Status

#: "displacement-sign": shear stress has the sign of the shear displacement, point by point;
#: "slip-sign": it has the sign of the slip all along the rim, as the source papers print it.
BrakingLaw = Literal["displacement-sign", "slip-sign"]
#: Newton's steps from a start that is off by a few per cent of the distance to the nearer extreme.
NEWTON_STEPS = 4


def entry_angle(sinkage: Array, radius: Real) -> Array:
    r"""Angle (rad) from straight down at which a circle meets the surface.

    .. math:: \theta_1 = \arccos(1 - z / r) = 2 \arcsin\sqrt{z / (2 r)}

    The second form keeps all digits at small sinkage, where arccos loses them.
    """
    xp = namespace(sinkage)
    return 2.0 * xp.asin(xp.sqrt(sinkage / (2.0 * radius)))


def differences_from_entry(
    sin_entry: Array, cos_entry: Array, passed: Array
) -> tuple[Array, Array]:
    r"""Differences of sine and cosine between the entry angle and a point of the arc.

    .. math::
        \sin\theta_1 - \sin\theta = u (\cos\theta_1 + t \sin\theta_1), \quad
        \cos\theta - \cos\theta_1 = u (\sin\theta_1 - t \cos\theta_1), \quad
        t = \tan\frac{\theta_1 - \theta}{2}, \quad u = \frac{2 t}{1 + t^2}

    so that nothing cancels close to the entry. `passed` (rad) is the angle passed since entry,
    theta_1 - theta; the sine and cosine of theta_1 broadcast against it.
    """
    xp = namespace(passed)
    t = xp.tan(0.5 * passed)
    u = 2.0 * t / (1.0 + t * t)
    return u * (cos_entry + t * sin_entry), u * (sin_entry - t * cos_entry)


def displacement_slip(slip: Array, law: BrakingLaw) -> Array:
    r"""Slip s' of the shear displacement, of any shape.

    .. math::
        j(\theta) = r [\theta_1 - \theta - (1 - s')(\sin\theta_1 - \sin\theta)], \quad
        1 - s' = \frac{v}{r \omega} = \begin{cases} 1 - s & s \ge 0 \\
        1 / (1 + s) & s < 0 \end{cases}

    By "slip-sign" s' is the slip itself, and 1 - s is the travel ratio of a driving wheel only.
    References: shear displacement as the integral of the slip velocity, Wong and Reece,
    J. Terramechanics 4(1), 1967; definitions of slip, Wong, Theory of Ground Vehicles, chapter 2.
    """
    if law == "slip-sign":
        return slip
    return namespace(slip).where(slip < 0, slip / (1.0 + slip), slip)


def displacement_direction(displacement: Array, slip: Array, law: BrakingLaw) -> Array:
    """Direction of the shear stress, 1 or -1, at points of this shear displacement.

    `displacement` has shape (points, batch) or (batch,), `slip` (batch,); the answer has the shape
    of `slip` where nothing brakes, or where the direction is that of the slip.
    """
    xp = namespace(slip)
    if law == "slip-sign" or not bool(xp.any(slip < 0)):
        return xp.where(slip < 0, -xp.ones_like(slip), xp.ones_like(slip))
    one = xp.ones_like(displacement)
    return xp.where((slip < 0) & (displacement < 0), -one, one)


def reversals(entry: Array, leave: Array, slip: Array) -> tuple[Array, Array]:
    r"""Angles (rad) at which shear displacement is back at zero, and which of them there are.

    .. math::
        g(\theta) = g(\theta_1), \quad g(\theta) = (1 - s) \sin\theta - \theta, \quad
        g'(\pm\alpha) = 0, \quad \cos\alpha = \frac{1}{1 - s}, \quad s < 0

    A braking wheel that has sunk deep first pushes the soil back, as its rim moves steeply down,
    pulls it forward only below alpha, and pushes back again behind -alpha, where it moves steeply
    up. So there may be a zero between the two, on the falling branch of g, and, where the rim
    touches the soil so far behind the axle, one on the branch behind -alpha. Newton's method
    starts from the cubic that has the extremes of g, whose zeros are
    2 alpha sin([asin(g(theta_1) / g(alpha))] / 3) and the same less a third of a turn. `slip` is
    that of the shear displacement (`displacement_slip`); `entry`, `leave` and it have
    shape (batch,), the answers (2, batch).
    References: the shear displacement of Wong and Reece 1967; own derivation.
    """
    xp = namespace(entry)
    m = 1.0 - slip
    # the half angle keeps all digits at small slip, where arccos loses them
    braking = xp.maximum(-slip, xp.full_like(slip, 1e-300))
    turning = 2.0 * xp.asin(xp.sqrt(0.5 * braking / m))
    level, most = m * xp.sin(entry) - entry, m * xp.sin(turning) - turning
    height = level / xp.maximum(most, xp.full_like(most, 1e-300))
    whole = xp.full_like(height, 1.0 - 1e-15)
    third = xp.asin(xp.minimum(xp.maximum(height, -whole), whole)) / 3.0
    angle = 2.0 * turning * xp.sin(xp.stack([third, -math.pi / 3.0 - third], axis=0))
    for _ in range(NEWTON_STEPS):
        rate = m * xp.cos(angle) - 1.0
        step = (m * xp.sin(angle) - angle - level) / xp.where(rate == 0, 1.0 + 0.0 * rate, rate)
        angle = angle - step
    reached = (slip < 0) & (xp.abs(height) < 1.0) & (angle > leave) & (angle < entry)
    return angle, reached & xp.stack([entry > turning, leave < -turning], axis=0)


#: Smallest value of 3 - n in the initial sinkage, whose equation holds for n well below 3.
SMALLEST_DIVISOR = 0.5


@dataclass(frozen=True)
class WheelArc:
    """Entry, exit and maximum-stress angle of a wheel's contact, and the radii that matter.

    Angles are measured from straight down, positive forward; arrays of shape (batch,).
    """

    entry: Array  # rad
    exit: Array  # rad, zero or negative, unless stress sits at the front of the contact
    peak: Array  # rad, where the normal stress is largest
    sinkage: Array  # m
    radius: Real  # m
    shear_radius: Real  # m, radius at which soil is sheared; larger than the rim's with lugs
    lever: Real  # m, lever arm of the shear stress about the axle
    width: Real  # m
    travel: Real = 1.0  # radius by which the slip is reckoned, over the shear radius
    chord: Array | None = None  # rad, half angle of the part that lies flat; None: a full circle
    tilt: Array | None = None  # m, half the difference in depth of two slices; None: upright

    def with_entry(self, entry: Array, **changes: Any) -> WheelArc:
        """The arc with another entry angle, of which the other angles keep their share."""
        share = entry / self.entry
        angles = {"peak": self.peak * share, "exit": self.exit * share}
        return replace(self, entry=entry, **angles | changes)

    def travelled(self, slip: Array, law: BrakingLaw) -> Array:
        """Travel of the axle over that of the shearing surface, of slip ratios (batch,)."""
        return (1.0 - displacement_slip(slip, law)) * self.travel


def depth_at(rim: WheelArc, passed: Array) -> Array:
    """Depth (m) below the free surface of points of the rim, by the angle passed since entry."""
    xp = namespace(passed)
    # r (cos(theta) - cos(theta_1)), as in `differences_from_entry`
    t = xp.tan(0.5 * passed)
    u = 2.0 * t / (1.0 + t * t)
    return rim.radius * u * (xp.sin(rim.entry) - t * xp.cos(rim.entry))


def pressed_depth(rim: WheelArc, angle: Array) -> Array:
    """Depth (m) that sets the pressure at angles (rad): behind the maximum, that before it.

    The mirrored angle is at the same fraction of the way from the entry to the maximum.
    """
    xp = namespace(angle)
    mirrored = (angle - rim.exit) * ((rim.entry - rim.peak) / (rim.peak - rim.exit))
    depth = depth_at(rim, xp.where(angle < rim.peak, mirrored, rim.entry - angle))
    return xp.maximum(depth, xp.full_like(depth, SMALLEST_DEPTH))


def contact_at(
    rim: WheelArc, at: Operating, passed: Array, depth: Array, arc: Array, law: BrakingLaw
) -> Contact:
    """Contact at points given by the angle passed since entry (rad); all arrays (points, batch).

    `depth` (m) sets the pressure, `arc` (rad) is the angle that a point represents.
    """
    xp = namespace(passed)
    sin_entry, cos_entry = xp.sin(rim.entry), xp.cos(rim.entry)
    sin_difference, cos_difference = differences_from_entry(sin_entry, cos_entry, passed)
    travelled = rim.travelled(at.slip, law)
    displacement = rim.shear_radius * (passed - travelled * sin_difference)
    area = rim.radius * rim.width * arc
    return Contact(
        depth=depth,
        shear_displacement=displacement,
        surface_travel=rim.shear_radius * passed,
        area=area,
        horizontal_area=area * (cos_entry + cos_difference),
        frontal_area=area * (sin_entry - sin_difference),
        shear_lever_arm=rim.lever,
        width=rim.width,
        shear_direction=displacement_direction(displacement, at.slip, law),
        travel_ratio=travelled,
        geometry=rim,
    )


def way_to_peak(contact: Contact) -> Array:
    """How far points (points, batch) are from the nearer end of a wheel's contact to its maximum.

    0 at entry and exit, 1 at the maximum stress, by the angle.
    """
    rim: WheelArc = contact.geometry
    xp = namespace(contact.surface_travel)
    passed = contact.surface_travel / rim.shear_radius
    before = passed / (rim.entry - rim.peak)
    behind = (rim.entry - rim.exit - passed) / (rim.peak - rim.exit)
    return xp.maximum(xp.minimum(before, behind), xp.zeros_like(before))


def largest_pressure(contact: Contact, soil: Soil) -> Array:
    r"""Bekker's pressure at the angle of maximum stress of a wheel, Pa, (batch,).

    .. math:: \sigma_m = (k_c / b + k_\varphi) [r (\cos\theta_m - \cos\theta_1)]^n
    """
    rim: WheelArc = contact.geometry
    xp = namespace(rim.entry)
    half_sum, half = 0.5 * (rim.entry + rim.peak), 0.5 * (rim.entry - rim.peak)
    depth = 2.0 * rim.radius * xp.sin(half_sum) * xp.sin(half)
    return (soil.kc / contact.width + soil.kphi) * xp.exp(soil.n * xp.log(depth))


class RoundGear(ABC):
    """What gears share whose rim or sole is an arc of a circle in the soil."""

    radius: Real
    width: Real

    @final
    def largest_sinkage(self) -> Real:
        """The radius, m: the centre of the circle is at the free surface."""
        return self.radius

    @final
    def contact_geometry(self, sinkage: Array, soil: Soil, at: Operating) -> WheelArc:
        r"""The arc at this sinkage (m) that leaves the soil straight below the centre.

        .. math::
            \theta_1 = \arccos(1 - z / r), \quad \theta_2 = 0, \quad
            \theta_m = (a_0 + a_1 s) \theta_1

        References: Wong and Reece, J. Terramechanics 4(1), 1967.
        """
        xp = namespace(sinkage)
        entry = entry_angle(sinkage, self.radius)
        return WheelArc(
            entry=entry,
            exit=xp.zeros_like(entry),
            peak=(soil.a0 + soil.a1 * at.slip) * entry,
            sinkage=sinkage,
            radius=self.radius,
            shear_radius=self.radius,
            lever=self.radius,
            width=self.width,
        )

    @final
    def geometry_status(self, geometry: WheelArc) -> Array:
        """`Status.NO_PEAK` where the maximum stress does not lie inside the arc, else 0."""
        xp = namespace(geometry.entry)
        inside = (geometry.peak > geometry.exit) & (geometry.peak < geometry.entry)
        ok = xp.zeros_like(geometry.entry, dtype=xp.int64)
        return xp.where(inside, ok, ok + int(Status.NO_PEAK))


@dataclass(frozen=True, kw_only=True)
class RigidWheel(RoundGear):
    """A rigid cylinder in the soil, for any assumption on the stresses along its arc.

    `braking` names the law of shear while it brakes (`soilml.physics.gears.rigid_wheel`).
    """

    radius: Annotated[Real, Parameter("m", 0.005, 5.0, "r, radius of the rim")]
    width: Annotated[Real, Parameter("m", 0.002, 5.0, "b, width of the rim")]
    braking: BrakingLaw = "displacement-sign"

    def __post_init__(self) -> None:
        if self.braking not in (laws := get_args(BrakingLaw)):
            raise InputError(f"braking is {self.braking!r}; there are: {', '.join(laws)}")

    @final
    def initial_sinkage(self, soil: Soil, at: Operating) -> Array:
        r"""Sinkage under normal stress alone, m, where the search begins.

        .. math::
            z = \left[\frac{3 W}{(3 - n) (k_c + b k_\varphi) \sqrt{2 r}}\right]^{2 / (2 n + 1)}

        References: Bekker 1969, eq. for the towed rigid wheel; good for n below 1.3.
        """
        xp = namespace(at.load)
        modulus = soil.kc + self.width * soil.kphi
        divisor = xp.maximum(3.0 - soil.n, xp.full_like(3.0 - soil.n, SMALLEST_DIVISOR))
        base = 3.0 * at.load / (divisor * modulus * xp.sqrt(2.0 * self.radius))
        return base ** (2.0 / (2.0 * soil.n + 1.0))


LIFTED = 1e-9  # Sinkage of a slice that is out of the soil, as a fraction of the wheel's
#: Fields of `Contact` with a value at each point.
AT_POINTS = (
    *("depth", "shear_displacement", "surface_travel"),
    *("area", "horizontal_area", "frontal_area"),
)
_ANGLES = ("entry", "peak", "exit")


def sliced_contact(rim: WheelArc, contact_of: Callable[[WheelArc], Contact]) -> Contact:
    """The points of two slices of half the width, `rim.tilt` (m) deeper and less deep than it.

    `contact_of` gives the contact of one arc. Angles keep their share of the entry angle.
    """
    xp = namespace(rim.entry)
    lifted = LIFTED * rim.sinkage
    depths = (rim.sinkage + rim.tilt, xp.maximum(rim.sinkage - rim.tilt, lifted))
    whole = entry_angle(rim.sinkage, rim.radius)
    slices = [
        rim.with_entry(rim.entry * (entry_angle(z, rim.radius) / whole), sinkage=z, tilt=None)
        for z in depths
    ]
    parts = [contact_of(own) for own in slices]
    points = [part.depth.shape[0] for part in parts]

    def joined(values: list[Any]) -> Array:
        both = zip(values, points, strict=True)
        return xp.concat([xp.broadcast_to(v, (n, v.shape[-1])) for v, n in both], axis=0)

    angles = {name: joined([getattr(own, name) for own in slices]) for name in _ANGLES}
    fields = {name: joined([getattr(part, name) for part in parts]) for name in AT_POINTS}
    for name in ("area", "horizontal_area", "frontal_area"):
        fields[name] = 0.5 * fields[name]
    for name in ("shear_lever_arm", "normal_lever_arm", "shear_direction"):
        if getattr(getattr(parts[0], name), "ndim", 0) > 1:
            fields[name] = joined([getattr(part, name) for part in parts])
    return replace(parts[0], **fields, geometry=replace(rim, **angles))
