"""The flexible track on two end wheels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, final

import numpy as np

from soilml.arrays import Array, Real, namespace
from soilml.errors import InputError
from soilml.parameters import Parameter, as_numbers
from soilml.physics.contact import Contact, Resolution
from soilml.physics.gears.rigid_wheel import SMALLEST_DIVISOR, entry_angle
from soilml.physics.gears.track_belt import Belt, belt_contact, belt_profile
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil

#: Nodes of the arc that enters the soil, of each part of the middle arc, and of each short
#: segment; their accuracy is tested against dense quadrature.
NODES = {Resolution.FULL: (16, 16, 8), Resolution.FIT: (16, 16, 8), Resolution.COARSE: (4, 4, 4)}


@final
@dataclass(frozen=True, kw_only=True)
class Track:
    r"""One track unit: a belt around two end wheels, an arc that bulges upwards between them.

    .. math::
        \theta_{12} = A_{12} \theta_{11}, \quad \theta_{21} = \theta_{12} + 2 \psi, \quad
        \theta_{22} = A_{22} \theta_{21}, \quad L \sin\psi = z_2 - z_1 = R_{1f} z_1

        R_t = \frac{L - 2 r \sin m}{2 \sin m}, \quad m = \theta_{12} + \psi, \qquad
        dj = [1 - (1 - i) \cos\alpha] ds

    with alpha the inclination of the belt. The soil is loaded along k z^n under the front wheel as
    far as z_1, springs back and is loaded again along k_u (`track_belt.equivalent_depth`), and
    follows k z^n again where the rear wheel presses it deeper. Where the belt rises so far that no
    pressure remains it does not touch, and there is no shear either (`track_belt.shear_retention`).
    Load and forces are those of one track. References: Wang, Yan and Du, J. Terramechanics 77,
    2018, eqs. 1-9; Okello, Watany and Crolla, J. agric. Engng Res. 69, 1998. The trim angle comes
    from the balance of displacements, so that the centre of mass and the hitch follow from it.
    Tensions at the joints are inner forces. While it brakes, shear reverses between the nodes:
    forces are then accurate to some parts in a thousand, at worst in a hundred. Where shear is many
    times the load, sinkage need not rise with the load. Not for belts stiff in bending, road wheels
    between the end wheels, or turning.
    """

    name: ClassVar[str] = "track"
    radius: Annotated[Real, Parameter("m", 0.005, 5.0, "r, radius of an end wheel with the belt")]
    width: Annotated[Real, Parameter("m", 0.002, 5.0, "b, width of the belt")]
    base: Annotated[Real, Parameter("m", 0.011, 20.0, "L, distance between the axles")]
    leaving: Annotated[
        Real, Parameter("1", 0.001, 0.5, "A_12, angle at which the belt leaves / entry angle")
    ] = 0.1
    rear_leaving: Annotated[
        Real, Parameter("1", 0.0, 1.0, "A_22, exit angle of the rear wheel / its entry angle")
    ] = 1.0
    settling: Annotated[
        Real, Parameter("1", 0.0, 0.5, "R_1f, further sinkage of the rear wheel / sinkage")
    ] = 0.2
    rebound: Annotated[
        Real, Parameter("1", 0.01, 1.0, "rho, share of sinkage sprung back; k_u = k z^(n-1) / rho")
    ] = 0.5

    def __post_init__(self) -> None:
        base, radius = as_numbers("base", self.base), as_numbers("radius", self.radius)
        if np.any(0.5 * base <= radius):
            raise InputError(
                f"base is {float(np.min(base)):g} m with wheels of radius "
                f"{float(np.max(radius)):g} m; it must be above twice the radius, or the wheels "
                "touch"
            )

    def largest_sinkage(self) -> Real:
        """Sinkage of the front wheel, m, at which the hub of the rear one is at the surface."""
        return self.radius / (1.0 + self.settling)

    def initial_sinkage(self, soil: Soil, at: Operating) -> Array:
        r"""Sinkage of a belt that lies flat, or of a front wheel that carries half, m.

        .. math::
            z = \min\left\{\left[\frac{W}{k b L}\right]^{1/n},
            \left[\frac{3 W / 2}{(3 - n) k b \sqrt{2 r}}\right]^{2 / (2 n + 1)}\right\}

        References: Bekker 1969; the second is Wang et al. 2018, eq. 2.
        """
        xp = namespace(at.load)
        modulus = soil.kc + self.width * soil.kphi + 0.0 * at.load
        divisor = xp.maximum(3.0 - soil.n, xp.full_like(3.0 - soil.n, SMALLEST_DIVISOR))
        flat = (at.load / (modulus * self.base)) ** (1.0 / soil.n)
        wheel = 1.5 * at.load / (divisor * modulus * xp.sqrt(2.0 * self.radius + 0.0 * at.load))
        return xp.minimum(flat, wheel ** (2.0 / (2.0 * soil.n + 1.0)))

    def contact_geometry(self, sinkage: Array, soil: Soil, at: Operating) -> Belt:
        """The line of the belt when its front wheel is at this sinkage (m)."""
        xp = namespace(sinkage)
        entry = entry_angle(sinkage, self.radius)
        leave = self.leaving * entry
        trim = xp.asin(self.settling * sinkage / self.base)
        meet = leave + 2.0 * trim
        sin_mean = xp.sin(leave + trim)
        return Belt(
            entry=entry,
            leave=leave,
            meet=meet,
            exit=self.rear_leaving * meet,
            trim=trim,
            sinkage=sinkage,
            rear=sinkage * (1.0 + self.settling),
            arc_radius=0.5 * self.base / sin_mean - self.radius,
            radius=self.radius,
            width=self.width,
            rebound=self.rebound,
            n=soil.n,
        )

    def geometry_status(self, geometry: Belt) -> Array:
        """0: a belt of possible dimensions has a line at any sinkage down to the hub."""
        xp = namespace(geometry.entry)
        return xp.zeros_like(geometry.entry, dtype=xp.int64)

    def contact(
        self, geometry: Belt, at: Operating, resolution: Resolution = Resolution.FULL
    ) -> Contact:
        """The points along the belt where it touches the soil."""
        return belt_contact(geometry, at, *NODES[resolution])

    def profile_contact(self, geometry: Belt, at: Operating, points: int) -> tuple[Array, Contact]:
        """Evenly spaced points along the belt from entry to exit, and their inclinations.

        They have no area; where the belt does not touch they have neither depth nor shear.
        """
        return belt_profile(geometry, at, points)
