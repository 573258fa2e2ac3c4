"""Forces on a wheel under a measured normal stress."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from soilml.arrays import Array, Real
from soilml.parameters import Parameter, check
from soilml.physics.contact import Stress, integrate
from soilml.physics.gears.rigid_wheel import WheelArc
from soilml.physics.gears.wheel import contact_at
from soilml.physics.operating_point import MOST_SLIP, Operating
from soilml.systems.force_sensor_wheel.stress_profile import StressProfile


@dataclass(frozen=True)
class WheelForces:
    """Forces on a wheel, arrays of the batch's shape."""

    load: Array  # N, F_z, carried vertically
    drawbar_pull: Array  # N, F_x
    torque: Array  # N m


@dataclass(frozen=True, kw_only=True)
class ShearInputs:
    """Parameters of the integral from stress to forces; numbers, or arrays that broadcast."""

    magnification: Annotated[Real, Parameter("1", 0.0, 1e6, "M, true over measured stress")]
    shear_modulus: Annotated[Real, Parameter("m", 1e-6, 100.0, "k_x")]
    cohesion: Annotated[Real, Parameter("Pa", 0.0, 1e6, "c")]
    friction_angle: Annotated[Real, Parameter("rad", 0.0, 1.4, "phi")]
    slip: Annotated[Real, Parameter("1", -MOST_SLIP, MOST_SLIP, "slip ratio")]
    radius: Annotated[Real, Parameter("m", 0.005, 5.0, "r")]
    width: Annotated[Real, Parameter("m", 0.002, 5.0, "b")]


def forces_from_profile(
    profile: StressProfile,
    *,
    magnification: Real = 1.0,
    shear_modulus: Real,
    cohesion: Real = 0.0,
    friction_angle: Real,
    slip: Real,
    radius: Real,
    width: Real,
) -> WheelForces:
    r"""Integrate a measured stress to load F_z, drawbar pull F_x (N) and torque (N m).

    .. math::
        \tau = (c + M \sigma_s \tan\varphi) (1 - e^{-|j| / k_x}), \quad
        j = r [\theta_f - \theta - (1 - s)(\sin\theta_f - \sin\theta)]

        F_x = r b \int (\tau \cos\theta - M \sigma_s \sin\theta) d\theta, \quad
        F_z = r b \int (\tau \sin\theta + M \sigma_s \cos\theta) d\theta

    where tau takes the sign of the slip and theta_f is the entry angle of the profile. All three
    forces are linear in M. Not valid for wheels whose lugs carry the load elsewhere on the rim than
    the sensors measure it: M is one number for the whole arc.

    Parameters
    ----------
    profile
        Measured normal stress sigma_s.
    magnification
        M, true over measured stress.
    shear_modulus
        k_x, m.
    cohesion, friction_angle
        c, Pa, and phi, rad.
    slip
        s; negative for a braking wheel.
    radius, width
        r and b, m.

    Returns
    -------
    WheelForces
        Arrays of the common shape of the parameters, which broadcast.

    Raises
    ------
    InputError
        For a value out of its bounds.

    References
    ----------
    Nagatani et al. 2009, eqs. 10-13.

    Examples
    --------
    >>> import numpy as np
    >>> profile = StressProfile(np.array([-0.1, 0.2, 0.5]), np.array([0.0, 2e4, 0.0]))
    >>> found = forces_from_profile(
    ...     profile, shear_modulus=0.0072, friction_angle=0.66,
    ...     slip=[0.1, 0.3], radius=0.055, width=0.064,
    ... )
    >>> np.round(found.drawbar_pull, 2)
    array([0.52, 4.22])
    """
    inputs = ShearInputs(
        magnification=magnification,
        shear_modulus=shear_modulus,
        cohesion=cohesion,
        friction_angle=friction_angle,
        slip=slip,
        radius=radius,
        width=width,
    )
    check(inputs)
    return integrate_profile(profile, inputs)


def integrate_profile(profile: StressProfile, inputs: ShearInputs) -> WheelForces:
    """As `forces_from_profile` without the check of bounds, for searches over a wide range."""
    parts = [np.asarray(value, dtype=np.float64) for value in vars(inputs).values()]
    batch = np.broadcast_shapes(*(part.shape for part in parts))
    magnification, modulus, cohesion, friction, slip, radius, width = parts
    angle, arc, normal = (part.reshape(-1, *(1 for _ in batch)) for part in profile.nodes)
    entry = np.asarray(profile.entry_angle)
    rim = WheelArc(
        entry=entry,
        exit=np.asarray(profile.exit_angle),
        peak=np.asarray(profile.peak_angle),
        sinkage=radius * (1.0 - np.cos(entry)),
        radius=radius,
        shear_radius=radius,
        lever=radius,
        width=width,
    )
    none = np.zeros_like(angle)
    at = Operating(slip=slip, load=none)
    contact = contact_at(rim, at, entry - angle, none, arc, "slip-sign")
    pressed = magnification * normal
    strength = cohesion + pressed * np.tan(friction)
    mobilised = -np.expm1(-np.abs(contact.shear_displacement) / modulus)
    shear = np.where(slip < 0, -1.0, 1.0) * strength * mobilised
    load, pull, torque = integrate(Stress(contact=contact, normal=pressed, shear=shear))
    load, pull, torque = (np.broadcast_to(part, batch) for part in (load, pull, torque))
    return WheelForces(load=load, drawbar_pull=pull, torque=torque)
