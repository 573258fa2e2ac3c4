"""Components of the forces of a wheel by soil parameter; the loads of the wheels of a rover."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Array, Floats, Real
from soilml.systems.climbing.climb import Climb, Rover, ShearParameters, WheelRun
from soilml.systems.force_sensor_wheel import forces_from_profile


@dataclass(frozen=True)
class ForceComponents:
    r"""Pull and load of a wheel at k_x, per unit of M, of M tan(phi) and of c.

    .. math::
        F_x = M (P_x + T_x \tan\varphi) + c C_x, \qquad
        F_z = M (P_z + T_z \tan\varphi) + c C_z

    with :math:`P_x = -r b \int \sigma_s \sin\theta\, d\theta`,
    :math:`T_x = r b \int \sigma_s m \cos\theta\, d\theta`,
    :math:`C_x = r b \int m \cos\theta\, d\theta`, and with sin and cos exchanged and the sign of
    P reversed for z; :math:`m = 1 - e^{-j / k_x}`. Arrays of the shape of k_x. From Nagatani
    et al., eqs. 8 and 9, which are linear in M, M tan(phi) and c.
    """

    pressure_pull: Array  # N
    pressure_lift: Array
    friction_pull: Array
    friction_lift: Array
    cohesion_pull: Array  # m^2
    cohesion_lift: Array

    def magnification(self, load: Real, cohesion: Real, tan_friction: Real) -> Array:
        """M with which the wheel carries `load` (N) at cohesion (Pa) and tan(phi)."""
        lift = self.pressure_lift + tan_friction * self.friction_lift
        return (load - cohesion * self.cohesion_lift) / lift

    def pull(self, magnification: Real, cohesion: Real, tan_friction: Real) -> Array:
        """Drawbar pull of the wheel, N."""
        stress = self.pressure_pull + tan_friction * self.friction_pull
        return magnification * stress + cohesion * self.cohesion_pull

    def load(self, magnification: Real, cohesion: Real, tan_friction: Real) -> Array:
        """Vertical load that the wheel carries, N."""
        stress = self.pressure_lift + tan_friction * self.friction_lift
        return magnification * stress + cohesion * self.cohesion_lift

    def interpolated(self, knot: NDArray[np.int_], share: Floats) -> ForceComponents:
        """Linear interpolation (m, n) of tabulated components (m, knots), `share` after `knot`."""
        return ForceComponents(
            *(v[:, knot] * (1.0 - share) + v[:, knot + 1] * share for v in vars(self).values())
        )


def stack_components(wheels: Sequence[ForceComponents]) -> ForceComponents:
    """The components (m, knots) of m wheels, each at the same k_x (knots,)."""
    rows = [vars(wheel).values() for wheel in wheels]
    return ForceComponents(*(np.stack(column) for column in zip(*rows, strict=True)))


def force_components(wheel: WheelRun, rover: Rover, shear_modulus: Real) -> ForceComponents:
    """The components of a wheel's forces at each k_x (m)."""
    modulus = np.asarray(shear_modulus, dtype=np.float64)
    shape = (3, *(1 for _ in modulus.shape))
    found = forces_from_profile(
        wheel.profile,
        magnification=np.reshape([1.0, 1.0, 0.0], shape),
        cohesion=np.reshape([0.0, 0.0, 1.0], shape),
        friction_angle=np.reshape([0.0, 0.25 * np.pi, 0.0], shape),
        shear_modulus=modulus[None],
        slip=wheel.slip,
        radius=rover.radius,
        width=rover.width,
    )
    pull, lift = found.drawbar_pull, found.load
    return ForceComponents(pull[0], lift[0], pull[1] - pull[0], lift[1] - lift[0], pull[2], lift[2])


def pull_of_rover(
    rover: Rover,
    slope: Real,
    wheels: tuple[ForceComponents, ForceComponents],
    cohesion: Real,
    tan_friction: Real,
) -> Array:
    r"""Drawbar pull 2 (F_xf + F_xr) (N) of a rover whose wheels carry its weight on the slope.

    The vertical balance, :math:`2 (F_{zf} + F_{zr}) = m g \cos\alpha`, gives the magnification: one
    for each wheel if the loads of the wheels are known, else one for both. References: Nagatani et
    al., eqs. 6, 7, 10 and 11.
    """
    front, rear = wheels
    if rover.has_known_loads:
        loads = rover.loads(slope)
        each = [
            w.magnification(load, cohesion, tan_friction)
            for w, load in zip(wheels, loads, strict=True)
        ]
    else:
        shared = shared_magnification(rover, slope, wheels, cohesion, tan_friction)
        each = [shared, shared]
    return 2.0 * (
        front.pull(each[0], cohesion, tan_friction) + rear.pull(each[1], cohesion, tan_friction)
    )


def shared_magnification(
    rover: Rover,
    slope: Real,
    wheels: tuple[ForceComponents, ForceComponents],
    cohesion: Real,
    tan_friction: Real,
) -> Array:
    """The common M of both wheels, from the vertical balance of the rover."""
    carried = 0.5 * rover.weight * np.cos(slope)
    lift = sum(w.pressure_lift + tan_friction * w.friction_lift for w in wheels)
    return (carried - cohesion * sum(w.cohesion_lift for w in wheels)) / lift


#: Smallest range of tan(slope) from which the height of the centre of mass is estimated.
MIN_SPAN = 0.1


def estimate_wheel_loads(rover: Rover, climbs: Sequence[Climb], shear: ShearParameters) -> Rover:
    r"""The rover with its centre of mass estimated from the climbs if it is unknown.

    .. math:: \frac{F_{zf}}{F_{zf} + F_{zr}} = a - h \tan\alpha

    is fitted by least squares to the front wheels' share of the load in each climb at the soil
    `shear`, with one magnification for both wheels of a run. h is estimated if three climbs or more
    span 0.1 in tan(alpha), and is 0 otherwise; a and h are limited to their bounds.
    """
    if rover.has_known_loads:
        return rover
    cohesion, friction, modulus = shear
    tan_friction = np.tan(friction)
    shares = []
    for climb in climbs:
        wheels = (
            force_components(climb.front, rover, modulus),
            force_components(climb.rear, rover, modulus),
        )
        shared = shared_magnification(rover, climb.slope, wheels, cohesion, tan_friction)
        front, rear = (wheel.load(shared, cohesion, tan_friction) for wheel in wheels)
        shares.append(float(front / (front + rear)))
    gradient = np.tan([climb.slope for climb in climbs])
    spans = len(climbs) > 2 and np.ptp(gradient) > MIN_SPAN
    fall, share = np.polyfit(gradient, shares, 1) if spans else (0.0, np.mean(shares))
    return replace(
        rover,
        front_share=float(np.clip(share, 0.05, 0.95)),
        height_ratio=float(np.clip(-fall, 0.0, 2.0)),
    )
