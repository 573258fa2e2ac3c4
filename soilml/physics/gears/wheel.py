"""The rigid wheel, by full integration of its stresses."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, final

from soilml.arrays import Array, namespace
from soilml.numerics.quadrature import columns, crowded_ends, crowded_start
from soilml.physics.contact import Contact
from soilml.physics.gears.rigid_wheel import NO_DEPTH, RigidWheel, WheelArc
from soilml.physics.gears.shear_reversal import reversals
from soilml.physics.operating_point import Operating

#: Nodes in each part of the contact; their accuracy over all inputs is tested against adaptive
#: quadrature.
DRIVING_NODES = 16
BRAKING_NODES = 24
#: Enough for a few per cent, to see whether the load was nearly reached.
ROUGH_NODES = 5


@final
@dataclass(frozen=True, kw_only=True)
class Wheel(RigidWheel):
    r"""A rigid cylinder: Bekker's pressure mirrored behind the angle of maximum stress.

    .. math::
        z(\theta) = r (\cos\theta - \cos\theta_1), \ \theta_m \le \theta \le \theta_1; \quad
        z(\theta) = r \left(\cos\left[\theta_1 - \frac{\theta - \theta_2}{\theta_m - \theta_2}
        (\theta_1 - \theta_m)\right] - \cos\theta_1\right), \ \theta_2 \le \theta < \theta_m

        j(\theta) = r [\theta_1 - \theta - (1 - s)(\sin\theta_1 - \sin\theta)]

    References: Wong and Reece, J. Terramechanics 4(1), 1967; the same set in Nagatani et al. 2009,
    eqs. 3-10. Holds for a rim that does not deform, straight travel, sinkage up to the hub, and
    wheels large against the soil's grains. Under the one wheel that Nagatani et al. measured, of
    0.11 m diameter, the stress is narrower and further forward (section IV).
    """

    name: ClassVar[str] = "wheel"

    def contact(self, shape: WheelArc, at: Operating) -> Contact:
        """The points along the arc; more of them where a braking wheel shears both ways."""
        xp = namespace(shape.entry)
        if bool(xp.any(at.slip < 0)):
            return _braking(shape, at)
        return _halves(shape, at, DRIVING_NODES)

    def rough(self, shape: WheelArc, at: Operating) -> Contact:
        """Few points whichever way the wheel slips."""
        return _halves(shape, at, ROUGH_NODES)

    def stations(self, shape: WheelArc, at: Operating, points: int) -> tuple[Array, Contact]:
        """Evenly spaced from entry to exit; they stand for no area."""
        xp = namespace(shape.entry)
        share = xp.linspace(0.0, 1.0, points, dtype=shape.entry.dtype)[:, None]
        passed = share * (shape.entry - shape.exit)
        front, rear = shape.entry - shape.peak, shape.peak - shape.exit
        behind = (1.0 - share) * (shape.entry - shape.exit) * (front / rear)
        depth = depth_along(shape, xp.where(passed <= front, passed, behind))
        none = xp.zeros_like(passed)
        return shape.entry - passed, contact_along(
            shape, at, passed, xp.maximum(depth, none + NO_DEPTH), none
        )


def _halves(rim: WheelArc, at: Operating, count: int) -> Contact:
    """Two parts, before and behind the maximum stress, nodes crowded where stress vanishes."""
    xp = namespace(rim.entry)
    x, weight = columns(crowded_start(count), rim.entry)
    front, rear = rim.entry - rim.peak, rim.peak - rim.exit
    passed = xp.concat([x * front, (rim.entry - rim.exit) - x * rear], axis=0)
    depth = depth_along(rim, x * front)  # nodes stand alike in both parts: the same pressures
    arc = xp.concat([weight * front, weight * rear], axis=0)
    return contact_along(rim, at, passed, xp.concat([depth, depth], axis=0), arc)


def _braking(rim: WheelArc, at: Operating) -> Contact:
    """Parts that end where shear displacement changes its direction and the shear curve bends.

    Three of them, or four where the rim reaches behind the axle and it may do so twice.
    """
    xp = namespace(rim.entry)
    x, weight = columns(crowded_ends(BRAKING_NODES), rim.entry)
    front, rear = rim.entry - rim.peak, rim.peak - rim.exit
    turn, turns = reversals(rim.entry, rim.exit, at.slip)
    halfway = xp.where(front > rear, rim.peak + 0.5 * front, rim.exit + 0.5 * rear)
    inner = [rim.peak, xp.where(turns[0, :], turn[0, :], halfway)]
    if bool(xp.any(turns[1, :])):
        below = 0.5 * (rim.exit + xp.minimum(*inner))
        inner.append(xp.where(turns[1, :], turn[1, :], below))
    between = xp.sort(xp.stack(inner, axis=0), axis=0)
    ends = [rim.exit, *(between[i, :] for i in range(len(inner))), rim.entry]
    passed, mapped, arc = [], [], []
    for low, high in pairwise(ends):
        length = high - low
        here = (rim.entry - high) + length * x
        behind = ((low - rim.exit) + length * (1.0 - x)) * (front / rear)
        passed.append(here)
        mapped.append(xp.where(high <= rim.peak, behind, here))
        arc.append(weight * length)
    depth = depth_along(rim, xp.concat(mapped, axis=0))
    return contact_along(rim, at, xp.concat(passed, axis=0), depth, xp.concat(arc, axis=0))


def depth_along(rim: WheelArc, passed: Array) -> Array:
    """Depth (m) below the free surface of points of the rim, by the angle passed since entry."""
    xp = namespace(passed)
    t = xp.tan(0.5 * passed)
    double = 2.0 * t / (1.0 + t * t)
    return rim.radius * double * (xp.sin(rim.entry) - t * xp.cos(rim.entry))


def contact_along(rim: WheelArc, at: Operating, passed: Array, depth: Array, arc: Array) -> Contact:
    """Contact at points given by the angle passed since entry (rad); all arrays (points, batch).

    `depth` (m) sets the pressure, `arc` (rad) is the angle that a point stands for. With t the
    tangent of half the angle passed, sines and cosines follow from those of the entry angle alone,
    and their differences do not cancel.
    """
    xp = namespace(passed)
    sin_entry, cos_entry = xp.sin(rim.entry), xp.cos(rim.entry)
    t = xp.tan(0.5 * passed)
    double = 2.0 * t / (1.0 + t * t)
    sin_gone = double * (cos_entry + t * sin_entry)  # sin(theta_1) - sin(theta)
    cos_gained = double * (sin_entry - t * cos_entry)  # cos(theta) - cos(theta_1)
    area = rim.radius * rim.width * arc
    return Contact(
        depth=depth,
        sheared=rim.shear_radius * (passed - (1.0 - at.slip) * sin_gone),
        rolled=rim.shear_radius * passed,
        area=area,
        up=area * (cos_entry + cos_gained),
        ahead=area * (sin_entry - sin_gone),
        lever=rim.lever,
        width=rim.width,
    )
