"""Contact, stress and force: the quantities through which gears, soils and effects interact."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from soilml.arrays import Array, Real, namespace
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil

#: Depth (m) in place of none, where the stress is zero: log(0) has no derivative.
SMALLEST_DEPTH = 1e-300
#: Shear strength (Pa) below which the shear stress counts as none.
SMALLEST_STRENGTH = 1e-30


class Resolution(Enum):
    """How finely a contact is divided into points for integration."""

    COARSE = "coarse"  # the load to a few per cent: where a search begins
    FIT = "fit"  # forces far within the noise of any sensor: what fits compare with readings
    FULL = "full"


@dataclass(frozen=True)
class Contact:
    """Points along the contact of a running gear, arrays (points, batch): points first.

    For a point where the gear's surface is inclined by an angle theta to the ground,
    `horizontal_area` is cos(theta) and `frontal_area` sin(theta) times `area`. A gear whose stress
    has a known shape between few points assigns the integrals of that shape to these points; the
    sums in `integrate` are then exact.
    """

    depth: Array  # m, depth that sets the pressure
    shear_displacement: Array  # m, since entry, positive when it drives the gear
    surface_travel: Array  # m, how far the gear's surface has moved past the point since entry
    area: Array  # m^2, area that the point represents
    horizontal_area: Array  # m^2, that area projected on the ground
    frontal_area: Array  # m^2, that area projected on the plane across the travel
    shear_lever_arm: Array  # m, of the shear stress about the axle
    width: Real  # m, the smaller dimension of the contact patch
    normal_lever_arm: Real | None = None  # m, of the normal stress, where it misses the axle
    shear_direction: Array | None = None  # 1 or -1, of the shear stress; None: that of the slip
    travel_ratio: Array | None = None  # v / (r omega), (batch,); None: 1 - slip
    geometry: Any = None  # of the type that the gear's `contact_geometry` returns


@dataclass(frozen=True)
class Stress:
    """Stress of the soil on the gear's surface at the points of a contact, (points, batch), Pa."""

    contact: Contact
    normal: Array
    shear: Array


@dataclass(frozen=True)
class Force:
    """Forces of the soil on a running gear; arrays of the batch's shape.

    A row whose `status` is not 0 has no equilibrium: its torque, drawbar pull, sinkage and entry
    angle are NaN. Its `load` is the largest that the soil carried where it is TOO_HEAVY, and means
    nothing otherwise.
    """

    load: Array  # N, vertical load carried
    torque: Array  # N m
    drawbar_pull: Array  # N
    sinkage: Array  # m
    entry_angle: Array  # rad
    status: Array  # codes of soilml.row_status.Status


def stress(contact: Contact, soil: Soil, at: Operating) -> Stress:
    r"""Bekker's pressure and Janosi and Hanamoto's shear stress at every point of the contact.

    .. math::
        \sigma = (k_c / b + k_\varphi) z^n, \qquad
        \tau = (c + \sigma \tan\varphi) (1 - e^{-|j| / K})

    with the direction that the contact gives to the shear stress, else that of the slip.
    Arrays (points, batch). References: Bekker 1969; Janosi and Hanamoto, Proc. 1st ISTVS, 1961.
    Not for soils whose shear curve peaks and falls (Wong's hump), nor for repeated loading.
    """
    xp = namespace(contact.depth)
    modulus = soil.kc / contact.width + soil.kphi
    normal = modulus * xp.exp(soil.n * xp.log(contact.depth))
    strength = soil.cohesion + normal * xp.tan(soil.friction_angle)
    shear = strength * mobilised_fraction(xp.abs(contact.shear_displacement), soil)
    shear = shear * shear_direction(contact, at)
    return Stress(contact=contact, normal=normal, shear=shear)


def with_normal(stress: Stress, normal: Array, soil: Soil) -> Stress:
    """The stresses with another normal stress (Pa), and the shear stress that its friction permits.

    The mobilised share of the strength c + sigma tan(phi) stays.
    """
    tan = namespace(normal).tan(soil.friction_angle)
    return with_strength(
        replace(stress, normal=normal),
        before=soil.cohesion + stress.normal * tan,
        strength=soil.cohesion + normal * tan,
    )


def with_strength(stress: Stress, before: Array, strength: Array) -> Stress:
    """The stresses where the shear strength is `strength` in place of `before` (Pa)."""
    xp = namespace(before)
    ratio = strength / xp.maximum(before, xp.full_like(before, SMALLEST_STRENGTH))
    return replace(stress, shear=stress.shear * ratio)


def mobilised_fraction(displacement: Array, soil: Soil) -> Array:
    r"""Fraction of the shear strength that is mobilised, :math:`1 - e^{-j / K}`.

    `displacement` j (m) is not negative. References: Janosi and Hanamoto, Proc. 1st ISTVS, 1961.
    """
    remaining = namespace(displacement).exp(displacement * (-1.0 / soil.shear_modulus))
    return 1.0 - remaining


def shear_direction(contact: Contact, at: Operating) -> Array:
    """Direction of the shear stress, 1 or -1: (points, batch), or (batch,) where it is the slip's.

    The shear stress on a braking gear has the sign of the shear displacement or, by the law that
    the source papers print, that of the slip (`soilml.physics.gears.rigid_wheel`).
    """
    return slip_sign(at) if contact.shear_direction is None else contact.shear_direction


def travel_ratio(contact: Contact, at: Operating) -> Array:
    """Travel speed over rim speed, v / (r omega), (batch,), as the gear's shear law has it."""
    return 1.0 - at.slip if contact.travel_ratio is None else contact.travel_ratio


def slip_sign(at: Operating) -> Array:
    """-1 where the gear brakes, else 1."""
    xp = namespace(at.slip)
    return xp.where(at.slip < 0, -xp.ones_like(at.slip), xp.ones_like(at.slip))


def integrate(stress: Stress) -> tuple[Array, Array, Array]:
    r"""Vertical load (N), drawbar pull (N) and torque (N m), integrated over the contact.

    .. math::
        W = \int (\sigma \cos\theta + \tau \sin\theta) dA, \quad
        DP = \int (\tau \cos\theta - \sigma \sin\theta) dA, \quad
        T = \int (\tau R + \sigma R_n) dA

    where R_n is the lever arm of the normal stress, zero where the surface is an arc about the
    axle. References: Wong and Reece 1967, eqs. of equilibrium of a driven rigid wheel; Comin and
    Saaj 2017, eq. 17, for a surface that is not.
    """
    xp, contact = namespace(stress.normal), stress.contact
    normal, shear = stress.normal, stress.shear
    pull = xp.sum(shear * contact.horizontal_area - normal * contact.frontal_area, axis=0)
    if contact.normal_lever_arm is None and contact.shear_lever_arm.ndim < 2:
        torque = contact.shear_lever_arm * xp.sum(shear * contact.area, axis=0)
        return vertical_load(stress), pull, torque
    torque_per_area = shear * contact.shear_lever_arm
    if contact.normal_lever_arm is not None:
        torque_per_area = torque_per_area + normal * contact.normal_lever_arm
    return vertical_load(stress), pull, xp.sum(torque_per_area * contact.area, axis=0)


def vertical_load(stress: Stress) -> Array:
    """Vertical load (N) that the stresses carry, (batch,); see `integrate`."""
    xp, contact = namespace(stress.normal), stress.contact
    load = stress.normal * contact.horizontal_area + stress.shear * contact.frontal_area
    return xp.sum(load, axis=0)
