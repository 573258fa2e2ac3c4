"""The foot of a wheel-leg in the middle of its stance."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Array, Real, namespace
from soilml.numerics.quadrature import between
from soilml.parameters import Parameter
from soilml.physics.contact import Contact, Resolution
from soilml.physics.gears.rigid_wheel import (
    WheelArc,
    contact_at,
    entry_angle,
    pressed_depth,
    reversals,
)
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil
from soilml.row_status import Status

#: Nodes in each part of the contact, two parts when driving and three when braking.
NODES = {Resolution.FULL: 16, Resolution.FIT: 16, Resolution.COARSE: 5}
LARGEST_INITIAL = 0.5  # Largest initial sinkage, as a fraction of the radius


@dataclass(frozen=True)
class Sole:
    """The part of a foot's circle that is in the soil; angles from straight down, (batch,).

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
    hub_offset: Real  # m, d, height of the hub above the centre of the arc


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

    def largest_sinkage(self) -> Real:
        """The radius, m: the centre of the foot's arc is at the free surface."""
        return self.radius

    def initial_sinkage(self, soil: Soil, at: Operating) -> Array:
        """Sinkage of a plate of the foot's area, m, at most half the radius."""
        xp = namespace(at.load)
        pressure = at.load / self.area
        sinkage = (pressure / (soil.kc / self.width + soil.kphi)) ** (1.0 / soil.n)
        return xp.minimum(sinkage, LARGEST_INITIAL * self.radius + 0.0 * sinkage)

    def contact_geometry(self, sinkage: Array, soil: Soil, at: Operating) -> Sole:
        """The sole of a foot at this sinkage (m), its heel end straight below the hub."""
        xp = namespace(sinkage)
        entry = entry_angle(sinkage, self.radius)
        return Sole(
            entry=entry,
            peak=(soil.a0 + soil.a1 * at.slip) * entry,
            top=xp.minimum(entry, self.arc + 0.0 * entry),
            sinkage=sinkage,
            radius=self.radius,
            width=self.width,
            hub_offset=self.leg_length + self.tip_height - self.radius,
        )

    def geometry_status(self, geometry: Sole) -> Array:
        """`Status.NO_PEAK` where the maximum stress does not lie on the circle's arc, else 0."""
        xp = namespace(geometry.entry)
        ok = xp.zeros_like(geometry.entry, dtype=xp.int64)
        inside = (geometry.peak > 0) & (geometry.peak < geometry.entry)
        return xp.where(inside, ok, ok + int(Status.NO_PEAK))

    def contact(
        self, geometry: Sole, at: Operating, resolution: Resolution = Resolution.FULL
    ) -> Contact:
        """The points along the sole."""
        return _sole_contact(geometry, at, NODES[resolution])

    def profile_contact(self, geometry: Sole, at: Operating, points: int) -> tuple[Array, Contact]:
        """Evenly spaced points from the top of the sole to below the hub, without area."""
        xp = namespace(geometry.entry)
        fraction = xp.linspace(1.0, 0.0, points, dtype=geometry.entry.dtype)[:, None]
        angle = fraction * geometry.top
        return angle, _contact_at(geometry, at, angle, xp.zeros_like(angle))


def _sole_contact(sole: Sole, at: Operating, count: int) -> Contact:
    """Parts that end at the maximum stress and where a braking foot's shear changes direction."""
    xp = namespace(sole.entry)
    heel = 0.0 * sole.top  # straight below the hub
    inner = [xp.minimum(sole.peak, sole.top)]
    if bool(xp.any(at.slip < 0)):
        # the heel is not behind the hub, where a second reversal could be
        reversal, exists = reversals(sole.entry, heel, at.slip)
        first = xp.where(exists[0, :], reversal[0, :], 0.5 * sole.top)
        inner.append(xp.minimum(first, sole.top))
    return _contact_at(sole, at, *between(heel, inner, sole.top, count))


def _contact_at(sole: Sole, at: Operating, angle: Array, arc: Array) -> Contact:
    """Contact at these angles (rad), each representing `arc` (rad); arrays (points, batch)."""
    xp = namespace(angle)
    circle = WheelArc(
        entry=sole.entry,
        exit=xp.zeros_like(sole.entry),
        peak=sole.peak,
        sinkage=sole.sinkage,
        radius=sole.radius,
        shear_radius=sole.radius,
        lever=sole.radius,
        width=sole.width,
    )
    depth = pressed_depth(circle, angle)
    return replace(
        contact_at(circle, at, sole.entry - angle, depth, arc, "slip-sign"),
        shear_lever_arm=sole.radius + sole.hub_offset * xp.cos(angle),
        normal_lever_arm=-sole.hub_offset * xp.sin(angle),
    )
