"""The forces of a wheel, taken apart into what each soil parameter does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Array, Real
from soilml.systems.climbing.climb import WheelRun
from soilml.systems.climbing.rover import Rover
from soilml.systems.force_sensor_wheel import forces

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Parts:
    r"""What a wheel pulls and carries at k_x, per unit of M, of M tan(phi) and of c.

    .. math::
        F_x = M (P_x + T_x \tan\varphi) + c C_x, \qquad
        F_z = M (P_z + T_z \tan\varphi) + c C_z

    with :math:`P_x = -r b \int \sigma_s \sin\theta\, d\theta`,
    :math:`T_x = r b \int \sigma_s m \cos\theta\, d\theta`,
    :math:`C_x = r b \int m \cos\theta\, d\theta`, and sin and cos changed over, with the sign of
    P, for z; :math:`m = 1 - e^{-j / k_x}`. Arrays of the shape of k_x. From Nagatani
    et al., eqs. 8 and 9, which are straight lines in M, M tan(phi) and c.
    """

    pressure_pull: Array  # N
    pressure_lift: Array
    friction_pull: Array
    friction_lift: Array
    cohesion_pull: Array  # m^2
    cohesion_lift: Array

    def magnification(self, load: Real, cohesion: Real, tangent: Real) -> Real:
        """M that lets the wheel carry `load` (N) at cohesion (Pa) and tan(phi)."""
        lift = self.pressure_lift + tangent * self.friction_lift
        return (load - cohesion * self.cohesion_lift) / lift

    def pull(self, magnification: Real, cohesion: Real, tangent: Real) -> Real:
        """Drawbar pull of the wheel, N."""
        stress = self.pressure_pull + tangent * self.friction_pull
        return magnification * stress + cohesion * self.cohesion_pull

    def load(self, magnification: Real, cohesion: Real, tangent: Real) -> Real:
        """Vertical load that the wheel carries, N."""
        stress = self.pressure_lift + tangent * self.friction_lift
        return magnification * stress + cohesion * self.cohesion_lift

    def between(self, low: NDArray[np.int_], share: Floats) -> Parts:
        """The parts (m, n) of m wheels at n places between knots; each part here is (m, knots)."""
        return Parts(
            *(v[:, low] * (1.0 - share) + v[:, low + 1] * share for v in vars(self).values())
        )


def stacked(wheels: Sequence[Parts]) -> Parts:
    """The parts (m, knots) of m wheels, each over the same k_x (knots,)."""
    rows = [vars(wheel).values() for wheel in wheels]
    return Parts(*(np.stack(column) for column in zip(*rows, strict=True)))


def parts(wheel: WheelRun, rover: Rover, shear_modulus: Real) -> Parts:
    """The parts of a wheel's forces at each k_x (m)."""
    modulus = np.asarray(shear_modulus, dtype=np.float64)
    each = (3, *(1 for _ in modulus.shape))
    found = forces(
        wheel.profile,
        magnification=np.reshape([1.0, 1.0, 0.0], each),
        cohesion=np.reshape([0.0, 0.0, 1.0], each),
        friction_angle=np.reshape([0.0, 0.25 * np.pi, 0.0], each),
        shear_modulus=modulus[None],
        slip=wheel.slip,
        radius=rover.radius,
        width=rover.width,
    )
    pull, lift = found.drawbar_pull, found.load
    return Parts(pull[0], lift[0], pull[1] - pull[0], lift[1] - lift[0], pull[2], lift[2])


def pull_of_rover(
    rover: Rover, slope: Real, wheels: tuple[Parts, Parts], cohesion: Real, tangent: Real
) -> Real:
    r"""Drawbar pull 2 (F_xf + F_xr) (N) of a rover whose wheels carry its weight on the slope.

    The vertical balance, :math:`2 (F_{zf} + F_{zr}) = m g \cos\alpha`, gives the magnification:
    one for each wheel where the rover knows its loads, else one for both. References: Nagatani et
    al., eqs. 6, 7, 10 and 11.
    """
    front, rear = wheels
    if rover.knows_loads:
        loads = rover.loads(slope)
        each = [
            w.magnification(load, cohesion, tangent) for w, load in zip(wheels, loads, strict=True)
        ]
    else:
        shared = shared_magnification(rover, slope, wheels, cohesion, tangent)
        each = [shared, shared]
    return 2.0 * (front.pull(each[0], cohesion, tangent) + rear.pull(each[1], cohesion, tangent))


def shared_magnification(
    rover: Rover, slope: Real, wheels: tuple[Parts, Parts], cohesion: Real, tangent: Real
) -> Real:
    """M of both wheels together, from the vertical balance of the rover."""
    carried = 0.5 * rover.weight * np.cos(slope)
    lift = sum(w.pressure_lift + tangent * w.friction_lift for w in wheels)
    return (carried - cohesion * sum(w.cohesion_lift for w in wheels)) / lift
