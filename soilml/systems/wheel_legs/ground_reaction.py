"""Many wheel-legs at once: their plates, and the force of the ground on them with its rates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from soilml.arrays import Array
from soilml.systems.wheel_legs.geometry import WheelLeg
from soilml.systems.wheel_legs.resistive_force import LinearGround, resistance_terms

#: Depth over which the offset of the normal stress builds up, m, so that the force is continuous.
SKIN = 0.001
#: Speed below which the direction of motion is regularised, as a fraction of the speed of the leg's
#: end: 1 mm/s for the paper's wheel-leg.
FADING = 0.02


@dataclass(frozen=True)
class WalkingLegs:
    """Wheel-legs on their grounds: plates at angle zero, (plates, cases), and numbers, (cases,)."""

    x: Array  # m
    z: Array  # m
    area: Array  # m^2; 0 pads cases with fewer plates
    c2: Array  # cos and sin of twice the tilt
    s2: Array
    turns: Array  # 1 for plates that turn with the wheel, 0 for the body
    speed: Array  # rad/s
    stiffness: Array  # N/m^3
    offset: Array  # Pa
    mass: Array  # kg
    tip_speed: Array  # m/s, of the leg's end about the hub
    legs: Array
    slip: Array  # commanded; NaN where the wheel rolls freely

    @staticmethod
    def of(wheels: Sequence[WheelLeg], grounds: Sequence[LinearGround], slip: Array) -> WalkingLegs:
        """Stack the plates of all cases, padded with plates of zero area."""
        plates = [wheel.plates() for wheel in wheels]
        most = max(p.x.size for p in plates)

        def padded(name: str) -> Array:
            columns = [np.asarray(getattr(p, name), float) for p in plates]
            return np.stack([np.pad(c, (0, most - c.size)) for c in columns], axis=1)

        tilt = padded("tilt")
        return WalkingLegs(
            x=padded("x"),
            z=padded("z"),
            area=padded("area"),
            c2=np.cos(2.0 * tilt),
            s2=np.sin(2.0 * tilt),
            turns=padded("turns"),
            speed=np.array([w.speed for w in wheels], float),
            stiffness=np.array([g.stiffness for g in grounds], float),
            offset=np.array([g.offset for g in grounds], float),
            mass=np.array([w.mass for w in wheels], float),
            tip_speed=np.array([w.speed * w.leg.length for w in wheels], float),
            legs=np.array([w.legs for w in wheels]),
            slip=np.asarray(slip, float),
        )

    def select(self, cases: Array) -> WalkingLegs:
        """A subset of the cases."""
        return WalkingLegs(**{f.name: getattr(self, f.name)[..., cases] for f in fields(self)})

    def at(self, angle: float) -> tuple[Array, Array, Array, Array]:
        """Plates relative to the hub (x, z) and doubled tilts (cos, sin) after turning by `angle`.

        In rad, forwards.
        """
        c, s = np.cos(angle * self.turns), np.sin(angle * self.turns)
        double_c, double_s = c * c - s * s, 2.0 * c * s
        return (
            self.x * c + self.z * s,
            self.z * c - self.x * s,
            self.c2 * double_c + self.s2 * double_s,
            self.s2 * double_c - self.c2 * double_s,
        )

    def reaction(
        self, pose: tuple[Array, Array, Array, Array], height: Array, ahead: Array, up: Array
    ) -> tuple[Array, Array]:
        r"""Force ahead and up (N), torque of the motor (N m), (3, cases); rates (2, 3, cases).

        The sum of the stresses of all plates (Comin and Saaj 2017, eq. 7) at a height (m) and
        velocity (m/s) of the hub, (cases,). Rates are of both forces by velocity ahead, velocity up
        and height. Stress depends on the direction of motion, not on its speed; slowly moving
        plates have it regularised,

        .. math:: \hat v \to v / \sqrt{v^2 + v_0^2}

        because the force on a resting foot would otherwise alternate from step to step.
        """
        depth = -(pose[1] + height)
        reached = np.flatnonzero(np.any((depth > 0.0) & (self.area > 0.0), axis=1))
        depth = depth[reached]
        area = np.where(depth > 0.0, self.area[reached], 0.0)
        x, z, c2, s2 = (part[reached] for part in pose)
        turns = self.turns[reached]
        turning = self.speed * turns
        vx, vz = ahead + turning * z, up - turning * x
        pace = np.sqrt(vx * vx + vz * vz + (FADING * self.tip_speed) ** 2)
        ux, uz = vx / pace, vz / pace
        skin = np.exp(-np.maximum(depth, 0.0) / SKIN)
        pressure = area * (self.stiffness * depth + self.offset * (1.0 - skin))
        gradient = area * (self.stiffness + self.offset / SKIN * skin)
        rest_x, rest_z, xx, xz, zx, zz = resistance_terms(c2, s2)
        sx, sz = rest_x - xx * ux - xz * uz, rest_z - zx * ux - zz * uz
        fx, fz = pressure * sx, pressure * sz
        # the motor works against the motion of the plates about the hub
        forces = np.stack([fx, fz, -turns * (fx * z - fz * x)]).sum(axis=1)
        weight = pressure / pace
        x_x, x_z, z_z = (1.0 - ux * ux) * weight, -ux * uz * weight, (1.0 - uz * uz) * weight
        rates = np.stack(
            [
                [xx * x_x + xz * x_z, xx * x_z + xz * z_z, gradient * sx],
                [zx * x_x + zz * x_z, zx * x_z + zz * z_z, gradient * sz],
            ]
        )
        return forces, -rates.sum(axis=2)
