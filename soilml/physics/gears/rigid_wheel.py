"""The contact arc of a rigid wheel."""

from __future__ import annotations

from abc import ABC
from dataclasses import dataclass
from typing import Annotated, final

from soilml.arrays import Array, Real, namespace
from soilml.parameters import Parameter
from soilml.physics.gears.arc import BrakingLaw, check_law, displacement_slip, entry_angle
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil
from soilml.row_status import Status

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
    #: radius by which the slip is reckoned, over the shear radius
    travel: Real = 1.0

    def travelled(self, slip: Array, law: BrakingLaw) -> Array:
        """Travel of the axle over that of the shearing surface, of slip ratios (batch,)."""
        return (1.0 - displacement_slip(slip, law)) * self.travel


@dataclass(frozen=True, kw_only=True)
class RigidWheel(ABC):
    """A rigid cylinder in the soil, for any assumption on the stresses along its arc.

    `braking` names the law of shear while it brakes (`soilml.physics.gears.arc`).
    """

    radius: Annotated[Real, Parameter("m", 0.005, 5.0, "r, radius of the rim")]
    width: Annotated[Real, Parameter("m", 0.002, 5.0, "b, width of the rim")]
    braking: BrakingLaw = "displacement-sign"

    def __post_init__(self) -> None:
        check_law(self.braking)

    @final
    def largest_sinkage(self) -> Real:
        """The radius, m: the hub is at the free surface."""
        return self.radius

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

    @final
    def contact_geometry(self, sinkage: Array, soil: Soil, at: Operating) -> WheelArc:
        r"""The arc of a wheel at this sinkage (m) that leaves the soil straight below its axle.

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
