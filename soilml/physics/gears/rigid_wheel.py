"""The arc of a rigid wheel that stands in the soil."""

from __future__ import annotations

from abc import ABC
from dataclasses import dataclass
from typing import Annotated, final

from soilml.arrays import Array, Real, namespace
from soilml.parameters import Parameter
from soilml.physics.operating_point import Operating
from soilml.physics.soils.soil import Soil
from soilml.row_status import Status

#: Stands for no depth, where the stress is zero: log(0) has no derivative.
NO_DEPTH = 1e-300


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
    shear_radius: Real  # m, radius at which soil is sheared; that of the rim unless lugs dig
    lever: Real  # m, lever arm of the shear stress about the axle
    width: Real  # m


@dataclass(frozen=True, kw_only=True)
class RigidWheel(ABC):
    """A rigid cylinder in the soil, whatever its stresses are taken to be along the arc."""

    radius: Annotated[Real, Parameter("m", 0.005, 5.0, "r, radius of the rim")]
    width: Annotated[Real, Parameter("m", 0.002, 5.0, "b, width of the rim")]

    @final
    def deepest(self) -> Real:
        """The hub stands at the free surface: the radius, m."""
        return self.radius

    @final
    def guess(self, soil: Soil, at: Operating) -> Array:
        r"""Sinkage under normal stress alone, m: where the search begins.

        .. math::
            z = \left[\frac{3 W}{(3 - n) (k_c + b k_\varphi) \sqrt{2 r}}\right]^{2 / (2 n + 1)}

        References: Bekker 1969, eq. for the towed rigid wheel; good for n below 1.3.
        """
        xp = namespace(at.load)
        modulus = soil.kc + self.width * soil.kphi
        room = xp.maximum(3.0 - soil.n, xp.full_like(3.0 - soil.n, 0.5))
        base = 3.0 * at.load / (room * modulus * xp.sqrt(2.0 * self.radius))
        return base ** (2.0 / (2.0 * soil.n + 1.0))

    @final
    def shape(self, sinkage: Array, soil: Soil, at: Operating) -> WheelArc:
        r"""The arc of a wheel that has sunk this deep (m) and leaves the soil below its axle.

        .. math::
            \theta_1 = \arccos(1 - z / r), \quad \theta_2 = 0, \quad
            \theta_m = (a_0 + a_1 s) \theta_1

        References: Wong and Reece, J. Terramechanics 4(1), 1967.
        """
        xp = namespace(sinkage)
        # arcsin of the half angle keeps all digits at small sinkage, where arccos loses them
        entry = 2.0 * xp.asin(xp.sqrt(sinkage / (2.0 * self.radius)))
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
    def flaw(self, shape: WheelArc) -> Array:
        """`Status.NO_PEAK` where the maximum stress does not lie inside the arc, else 0."""
        xp = namespace(shape.entry)
        inside = (shape.peak > shape.exit) & (shape.peak < shape.entry)
        ok = xp.zeros_like(shape.entry, dtype=xp.int64)
        return xp.where(inside, ok, ok + int(Status.NO_PEAK))
