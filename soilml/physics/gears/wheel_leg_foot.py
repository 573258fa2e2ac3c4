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
    RoundGear,
    WheelArc,
    contact_at,
    pressed_depth,
    reversals,
)
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil

#: Nodes in each part of the contact, two parts when driving and three when braking.
NODES = {Resolution.FULL: 16, Resolution.FIT: 16, Resolution.COARSE: 5}
LARGEST_INITIAL = 0.5  # Largest initial sinkage, as a fraction of the radius


@final
@dataclass(frozen=True, kw_only=True)
class Midstance(RoundGear):
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

    def initial_sinkage(self, soil: Soil, at: Operating) -> Array:
        """Sinkage of a plate of the foot's area, m, at most half the radius."""
        xp = namespace(at.load)
        pressure = at.load / self.area
        sinkage = (pressure / (soil.kc / self.width + soil.kphi)) ** (1.0 / soil.n)
        return xp.minimum(sinkage, LARGEST_INITIAL * self.radius + 0.0 * sinkage)

    def contact(
        self, geometry: WheelArc, at: Operating, resolution: Resolution = Resolution.FULL
    ) -> Contact:
        """Parts that end at the maximum stress and where a braking foot's shear turns round."""
        xp = namespace(geometry.entry)
        top = self._top(geometry)
        heel = 0.0 * top  # straight below the hub
        inner = [xp.minimum(geometry.peak, top)]
        if bool(xp.any(at.slip < 0)):
            # the heel is not behind the hub, where a second reversal could be
            reversal, exists = reversals(geometry.entry, heel, at.slip)
            first = xp.where(exists[0, :], reversal[0, :], 0.5 * top)
            inner.append(xp.minimum(first, top))
        return self._points(geometry, at, *between(heel, inner, top, NODES[resolution]))

    def profile_contact(
        self, geometry: WheelArc, at: Operating, points: int
    ) -> tuple[Array, Contact]:
        """Evenly spaced points from the top of the sole to below the hub, without area."""
        xp = namespace(geometry.entry)
        fraction = xp.linspace(1.0, 0.0, points, dtype=geometry.entry.dtype)[:, None]
        angle = fraction * self._top(geometry)
        return angle, self._points(geometry, at, angle, xp.zeros_like(angle))

    def _top(self, rim: WheelArc) -> Array:
        """Where the sole ends (rad): at the surface while the foot is not wholly under it.

        Where its own end lies below the maximum stress the stress is still rising there.
        """
        return namespace(rim.entry).minimum(rim.entry, self.arc + 0.0 * rim.entry)

    def _points(self, rim: WheelArc, at: Operating, angle: Array, arc: Array) -> Contact:
        """Contact at these angles (rad), each representing `arc` (rad); arrays (points, batch)."""
        xp = namespace(angle)
        hub_offset = self.leg_length + self.tip_height - self.radius
        passed, depth = rim.entry - angle, pressed_depth(rim, angle)
        return replace(
            contact_at(rim, at, passed, depth, arc, "slip-sign"),
            shear_lever_arm=self.radius + hub_offset * xp.cos(angle),
            normal_lever_arm=-hub_offset * xp.sin(angle),
        )
