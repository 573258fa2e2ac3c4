"""The rigid wheel with stresses that rise and fall along straight lines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, final

from soilml.arrays import Array, namespace
from soilml.physics.contact import SMALLEST_DEPTH, Contact, Resolution
from soilml.physics.gears.rigid_wheel import RigidWheel, WheelArc, contact_at
from soilml.physics.operating_point import Operating


@final
@dataclass(frozen=True, kw_only=True)
class LinearWheel(RigidWheel):
    r"""Closed form: stresses at exit, maximum and entry, joined by straight lines.

    .. math::
        W = r b [\sigma_m A + \tau_m B + \tau_0 (1 - \cos\theta_m - B_1)], \quad
        T = \tfrac12 r^2 b (\tau_m \theta_1 + \tau_0 \theta_m)

    for an exit straight below the axle; the weights of the two points below are the exact integrals
    of the straight lines, for any exit angle. References: Shibly, Iagnemma and Dubowsky, J.
    Terramechanics 42(1), 2005; Xue et al. 2016, eqs. 5-8, integrated here. Driving at slip 0.1 to
    0.6, a wheel of 0.15 m radius under 60 N in dry sand has a torque above that of the full
    integrals, most at small slip: by 0 to 7 % at K = 5 mm, 3 to 11 % at 15 mm and 4 to 12 % at 30
    mm. Over the input box of the tests the difference is -9 to +30 % in nine rows of ten. While it
    brakes, the shear stress at each point has the sign of its displacement, as under `Wheel`.
    """

    name: ClassVar[str] = "linear-wheel"

    def contact(
        self, geometry: WheelArc, at: Operating, resolution: Resolution = Resolution.FULL
    ) -> Contact:
        """Two points, exit and maximum stress; at entry there is no stress.

        The stress falls linearly from the maximum to both ends. With its value at a point factored
        out, the integral of cos or sin times that line over the front and the rear part of the arc
        is the weight of the point.
        """
        xp = namespace(geometry.entry)
        entry, peak, leave = geometry.entry, geometry.peak, geometry.exit
        front, rear = entry - peak, peak - leave
        sin, cos = xp.sin, xp.cos
        # weights of the maximum stress in the two parts, for cos and for sin of the angle
        cos_rear = (rear * sin(peak) + cos(peak) - cos(leave)) / rear
        cos_front = (cos(peak) - cos(entry) - front * sin(peak)) / front
        sin_rear = (sin(peak) - sin(leave) - rear * cos(peak)) / rear
        sin_front = (front * cos(peak) + sin(peak) - sin(entry)) / front
        # weights of the stress at exit: the whole rear part less that of the maximum
        cos_exit = sin(peak) - sin(leave) - cos_rear
        sin_exit = cos(leave) - cos(peak) - sin_rear
        scale = geometry.radius * geometry.width
        angle = xp.stack([leave, peak], axis=0)
        passed = entry - angle
        peak_depth = geometry.radius * (cos(peak) - cos(entry))
        depth = xp.stack([xp.full_like(peak, SMALLEST_DEPTH), peak_depth], axis=0)
        found = contact_at(geometry, at, passed, depth, 0.0 * passed, self.braking)
        return replace(
            found,
            area=scale * 0.5 * xp.stack([rear, front + rear], axis=0),
            horizontal_area=scale * xp.stack([cos_exit, cos_rear + cos_front], axis=0),
            frontal_area=scale * xp.stack([sin_exit, sin_rear + sin_front], axis=0),
        )

    def profile_contact(
        self, geometry: WheelArc, at: Operating, points: int
    ) -> tuple[Array, Contact]:
        """Exit and maximum, whatever `points`; stresses are linear between them, and to entry."""
        xp = namespace(geometry.entry)
        return xp.stack([geometry.exit, geometry.peak], axis=0), self.contact(geometry, at)
