"""The foot of a wheel-leg in the middle of its stance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, ClassVar, final

from soilml.arrays import Array, Real, namespace
from soilml.numerics.quadrature import crowded_ends
from soilml.parameters import Parameter
from soilml.physics.contact import Contact
from soilml.physics.gears.shear_reversal import reversals
from soilml.physics.operating_point import Operating
from soilml.physics.soils.soil import Soil
from soilml.row_status import Status

#: Nodes in each part of the contact, two parts when driving and three when braking.
NODES, ROUGH_NODES = 16, 5
#: Stands for no depth, where the stress is zero: log(0) has no derivative.
NO_DEPTH = 1e-300


@dataclass(frozen=True)
class Sole:
    """The part of a foot's circle that stands in the soil; angles from straight down, (batch,).

    The foot's arc ends at `top`: at `entry`, where its circle meets the surface, while the foot
    is not wholly under it (low sinkage), else at the arc's own end. Where that lies below `peak`
    (high sinkage) the stress is still rising there.
    """

    entry: Array  # rad, theta_1, of the circle
    peak: Array  # rad, theta_m, of the circle
    top: Array  # rad, the smaller of theta_1 and theta_1w
    sinkage: Array  # m
    radius: Real  # m
    width: Real  # m
    raised: Real  # m, how far the hub stands above the centre of the arc


@final
@dataclass(frozen=True, kw_only=True)
class Midstance:
    r"""A wheel-leg while one leg stands upright: a wheel of its foot's radius, cut at its foot.

    .. math::
        \theta_m = (a_0 + a_1 i) \theta_1, \quad
        j = R [\theta_1 - \theta - (1 - i)(\sin\theta_1 - \sin\theta)]

        F_V = b \int_0^{\min(\theta_1, \theta_{1w})} (\sigma \cos\theta + \tau \sin\theta) R
        d\theta, \quad
        T = b \int_0^{\min(\theta_1, \theta_{1w})}
        (\sigma \sin\Delta\theta + \tau \cos\Delta\theta) R^* R d\theta

    with Bekker's pressure in front of theta_m and its mirror image behind, as under a wheel. The
    printed cases low, medium and high sinkage are which of theta_1, theta_m and theta_1w comes
    first. The hub stands d = l_L + h_T - R above the centre of the arc, and

    .. math::
        R^* \cos\Delta\theta = R + d \cos\theta, \quad R^* \sin\Delta\theta = -d \sin\theta:

    normal stress, which points at the centre of the arc, helps the motor. References: Comin and
    Saaj 2017, eqs. 12-17; eq. 16 prints l_T for l_L. For one leg on the ground and a foot whose
    heel bears nothing (theta_2 = 0). Quasi-static, and by the source's own test wrong about how
    much soil stiffness matters, for attack and intrusion angles of a leg change all the time. A
    foot far under the surface bears little under the mirrored pressure, so that a load may have no
    sinkage at all; the row then says so.
    """

    name: ClassVar[str] = "midstance"
    radius: Annotated[Real, Parameter("m", 0.002, 5.0, "R, radius of the foot's arc")]
    width: Annotated[Real, Parameter("m", 0.002, 5.0, "b, width of the foot")]
    arc: Annotated[Real, Parameter("rad", 0.01, 1.57, "theta_1w, arc of the foot ahead of the leg")]
    leg_length: Annotated[Real, Parameter("m", 0.0, 5.0, "l_L, from the hub to the foot")]
    tip_height: Annotated[Real, Parameter("m", 0.0, 5.0, "h_T, of the foot below the leg")]

    @classmethod
    def of_foot(cls, length: Real, height: Real, width: Real, leg_length: Real) -> Midstance:
        r"""A foot that runs `length` (m) ahead of the leg's end and rises by `height` (m) there.

        .. math:: R = (l_T^2 + h_T^2) / (2 h_T), \quad \theta_{1w} = 2 \arctan(h_T / l_T)
        """
        rise = height / length
        plain = isinstance(rise, float)
        return cls(
            radius=(length**2 + height**2) / (2.0 * height),
            width=width,
            arc=2.0 * (math.atan(rise) if plain else namespace(rise).atan(rise)),
            leg_length=leg_length,
            tip_height=height,
        )

    @property
    def area(self) -> Real:
        """The sole of the whole foot, m^2: the patch A_s of the shear modulus K = K_A sqrt(A_s)."""
        return self.radius * self.arc * self.width

    def deepest(self) -> Real:
        """The centre of the foot's arc stands at the free surface, m."""
        return self.radius

    def guess(self, soil: Soil, at: Operating) -> Array:
        """Where a plate of the foot's size would rest, m, within what the gear holds for."""
        xp = namespace(at.load)
        pressure = at.load / self.area
        sinkage = (pressure / (soil.kc / self.width + soil.kphi)) ** (1.0 / soil.n)
        return xp.minimum(sinkage, 0.5 * self.radius + 0.0 * sinkage)

    def shape(self, sinkage: Array, soil: Soil, at: Operating) -> Sole:
        """The sole of a foot that has sunk this deep (m), its heel end straight below the hub."""
        xp = namespace(sinkage)
        entry = 2.0 * xp.asin(xp.sqrt(sinkage / (2.0 * self.radius)))
        return Sole(
            entry=entry,
            peak=(soil.a0 + soil.a1 * at.slip) * entry,
            top=xp.minimum(entry, self.arc + 0.0 * entry),
            sinkage=sinkage,
            radius=self.radius,
            width=self.width,
            raised=self.leg_length + self.tip_height - self.radius,
        )

    def flaw(self, shape: Sole) -> Array:
        """`Status.NO_PEAK` where the maximum stress does not lie on the circle's arc, else 0."""
        xp = namespace(shape.entry)
        ok = xp.zeros_like(shape.entry, dtype=xp.int64)
        inside = (shape.peak > 0) & (shape.peak < shape.entry)
        return xp.where(inside, ok, ok + int(Status.NO_PEAK))

    def contact(self, shape: Sole, at: Operating) -> Contact:
        """The points along the sole."""
        return _cut(shape, at, NODES)

    def rough(self, shape: Sole, at: Operating) -> Contact:
        """Few points."""
        return _cut(shape, at, ROUGH_NODES)

    def stations(self, shape: Sole, at: Operating, points: int) -> tuple[Array, Contact]:
        """Evenly spaced from the top of the sole to below the hub; they stand for no area."""
        xp = namespace(shape.entry)
        angle = xp.linspace(1.0, 0.0, points, dtype=shape.entry.dtype)[:, None] * shape.top
        return angle, _along(shape, at, angle, xp.zeros_like(angle))


def _cut(sole: Sole, at: Operating, count: int) -> Contact:
    """Parts that end at the maximum stress and where a braking foot's shear changes direction."""
    xp = namespace(sole.entry)
    bare = 0.0 * sole.top
    inner = [xp.minimum(sole.peak, sole.top)]
    if bool(xp.any(at.slip < 0)):
        turn, turns = reversals(sole.entry, bare, at.slip)
        inner.append(xp.minimum(xp.where(turns[0, :], turn[0, :], 0.5 * sole.top), sole.top))
    between = xp.sort(xp.stack(inner, axis=0), axis=0)
    ends = [bare, *(between[i, :] for i in range(len(inner))), sole.top]
    x, weight = (
        xp.asarray(v[:, None], dtype=bare.dtype, device=bare.device) for v in crowded_ends(count)
    )
    angle = xp.concat([low + (high - low) * x for low, high in pairwise(ends)], axis=0)
    arc = xp.concat([(high - low) * weight for low, high in pairwise(ends)], axis=0)
    return _along(sole, at, angle, arc)


def _along(sole: Sole, at: Operating, angle: Array, arc: Array) -> Contact:
    """Contact at these angles (rad), each standing for `arc` (rad); arrays (points, batch).

    Sines and cosines follow from the tangents of half the angles passed since entry, and their
    differences do not cancel.
    """
    xp = namespace(angle)
    sin_entry, cos_entry = xp.sin(sole.entry), xp.cos(sole.entry)
    passed = sole.entry - angle
    mirrored = angle * ((sole.entry - sole.peak) / sole.peak)
    t = xp.tan(0.5 * xp.where(angle < sole.peak, mirrored, passed))
    depth = 2.0 * sole.radius * t / (1.0 + t * t) * (sin_entry - t * cos_entry)
    t = xp.tan(0.5 * passed)
    double = 2.0 * t / (1.0 + t * t)
    sin_gone = double * (cos_entry + t * sin_entry)
    sin, cos = sin_entry - sin_gone, cos_entry + double * (sin_entry - t * cos_entry)
    area = sole.radius * sole.width * arc
    return Contact(
        depth=xp.maximum(depth, xp.zeros_like(depth) + NO_DEPTH),
        sheared=sole.radius * (passed - (1.0 - at.slip) * sin_gone),
        rolled=sole.radius * passed,
        area=area,
        up=area * cos,
        ahead=area * sin,
        lever=sole.radius + sole.raised * cos,
        normal_lever=-sole.raised * sin,
        width=sole.width,
    )
