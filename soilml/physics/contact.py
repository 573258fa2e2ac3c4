"""Contact, stress and force: where gears, soils and effects meet, and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass

from soilml.arrays import Array, Real, namespace
from soilml.physics.operating_point import Operating
from soilml.physics.soils.soil import Soil


@dataclass(frozen=True)
class Contact:
    """Points along the contact of a running gear, arrays (points, batch): points first.

    `up` and `ahead` are the area projected on the ground and on the direction of travel: for a
    point where the gear's surface stands at an angle theta from the ground, cos(theta) and
    sin(theta) times `area`. A gear whose stress follows a known shape between few points puts the
    integral of that shape there, and the sum in `integrate` is then exact.
    """

    depth: Array  # m, depth that sets the pressure
    sheared: Array  # m, shear displacement since entry, positive when it drives
    rolled: Array  # m, how far the gear's surface has moved past the point since entry
    area: Array  # m^2, area that the point stands for
    up: Array  # m^2, that area, projected on the ground
    ahead: Array  # m^2, that area, projected on the direction of travel
    lever: Array  # m, lever arm of the shear stress about the axle
    width: Real  # m, the smaller dimension of the contact patch
    normal_lever: Real = None  # m, of the normal stress, where it misses the axle


@dataclass(frozen=True)
class Stress:
    """Stress of the soil on the gear's surface at the points of a contact, (points, batch), Pa."""

    contact: Contact
    normal: Array
    shear: Array


@dataclass(frozen=True)
class Force:
    """What a running gear feels; arrays of the batch's shape.

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

    with the sign of the slip carried to the shear stress (a braking wheel is pulled back).
    Arrays (points, batch). References: Bekker 1969; Janosi and Hanamoto, Proc. 1st ISTVS, 1961.
    Not for soils whose shear curve peaks and falls (Wong's hump), nor for repeated loading.
    """
    xp = namespace(contact.depth)
    modulus = soil.kc / contact.width + soil.kphi
    normal = modulus * xp.exp(soil.n * xp.log(contact.depth))
    strength = soil.cohesion + normal * xp.tan(soil.friction_angle)
    mobilised = -xp.expm1(-xp.abs(contact.sheared) / soil.shear_modulus)
    sign = xp.where(at.slip < 0, -xp.ones_like(at.slip), xp.ones_like(at.slip))
    return Stress(contact=contact, normal=normal, shear=sign * strength * mobilised)


def integrate(stress: Stress) -> tuple[Array, Array, Array]:
    r"""Vertical load (N), drawbar pull (N) and torque (N m) of all points together.

    .. math::
        W = \int (\sigma \cos\theta + \tau \sin\theta) dA, \quad
        DP = \int (\tau \cos\theta - \sigma \sin\theta) dA, \quad
        T = \int (\tau R + \sigma R_n) dA

    where R_n is the lever arm of the normal stress, nothing where the surface is an arc about the
    axle. References: Wong and Reece 1967, eqs. of equilibrium of a driven rigid wheel; Comin and
    Saaj 2017, eq. 17, for a surface that is not.
    """
    xp, contact = namespace(stress.normal), stress.contact
    load = xp.sum(stress.normal * contact.up + stress.shear * contact.ahead, axis=0)
    pull = xp.sum(stress.shear * contact.up - stress.normal * contact.ahead, axis=0)
    turning = stress.shear * contact.lever
    if contact.normal_lever is not None:
        turning = turning + stress.normal * contact.normal_lever
    torque = xp.sum(turning * contact.area, axis=0)
    return load, pull, torque
