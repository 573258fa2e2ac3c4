"""Force of the ground on a batch of wheel-legs, and its derivatives with respect to motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from soilml.arrays import Array
from soilml.systems.wheel_legs.geometry import WheelLeg
from soilml.systems.wheel_legs.resistive_force import LinearGround, resistance_terms

#: Depth over which the offset of the normal stress builds up, m, so that the force is continuous.
SKIN = 0.001


@dataclass(frozen=True)
class PlateBatch:
    """Plates of all cases at angle zero, (plates, cases), and the ground of each case."""

    x: Array  # m
    z: Array  # m
    area: Array  # m^2; 0 pads cases with fewer plates
    c2: Array  # cos and sin of twice the tilt
    s2: Array
    turns: Array  # 1 for plates that turn with the wheel, 0 for the body
    speed: Array  # rad/s, (cases,)
    stiffness: Array  # N/m^3, (cases,)
    offset: Array  # Pa, (cases,)

    def select(self, cases: Array) -> PlateBatch:
        """A subset of the cases."""
        return PlateBatch(**{f.name: getattr(self, f.name)[..., cases] for f in fields(PlateBatch)})

    def at(self, angle: float) -> PlatePose:
        """The plates after the wheel has turned forwards by `angle`, rad."""
        c, s = np.cos(angle * self.turns), np.sin(angle * self.turns)
        double_c, double_s = c * c - s * s, 2.0 * c * s
        return PlatePose(
            x=self.x * c + self.z * s,
            z=self.z * c - self.x * s,
            c2=self.c2 * double_c + self.s2 * double_s,
            s2=self.s2 * double_c - self.c2 * double_s,
        )


@dataclass(frozen=True)
class PlatePose:
    """Plates relative to the hub at one instant, (plates, cases)."""

    x: Array
    z: Array
    c2: Array
    s2: Array


@dataclass(frozen=True)
class GroundReaction:
    """Ground reaction on the hub of every case, (cases,), and its derivatives."""

    ahead: Array  # N
    up: Array  # N
    torque: Array  # N m, motor torque that keeps the wheel turning
    velocity_jacobian: (
        Array  # N s/m, (2, 2, cases): of force (ahead, up) with respect to hub velocity (x, z)
    )
    height_derivative: Array  # N/m, (2, cases): of force with respect to hub height


def batch_plates(wheel_legs: Sequence[WheelLeg], grounds: Sequence[LinearGround]) -> PlateBatch:
    """Stack the plates of all cases, padded with plates of zero area."""
    plates = [wheel_leg.plates() for wheel_leg in wheel_legs]
    most = max(p.x.size for p in plates)

    def padded(name: str) -> Array:
        columns = [np.asarray(getattr(p, name), float) for p in plates]
        return np.stack([np.pad(c, (0, most - c.size)) for c in columns], axis=1)

    tilt = padded("tilt")
    return PlateBatch(
        x=padded("x"),
        z=padded("z"),
        area=padded("area"),
        c2=np.cos(2.0 * tilt),
        s2=np.sin(2.0 * tilt),
        turns=padded("turns"),
        speed=np.array([w.speed for w in wheel_legs], float),
        stiffness=np.array([g.stiffness for g in grounds], float),
        offset=np.array([g.offset for g in grounds], float),
    )


def ground_reaction(
    plates: PlateBatch, pose: PlatePose, height: Array, ahead: Array, up: Array, v0: Array
) -> GroundReaction:
    r"""Sum of the stresses of all plates (Comin and Saaj 2017, eq. 7).

    `height`, `ahead`, `up`: height (m) and velocity (m/s) of the hub, (cases,). Stress depends on
    the direction of motion, not on its speed; below about `v0` (m/s) the direction is regularised,

    .. math:: \hat v \to v / \sqrt{v^2 + v_0^2}

    because the force on a resting foot would otherwise alternate from step to step.
    """
    depth = -(pose.z + height)
    reached = np.flatnonzero(np.any((depth > 0.0) & (plates.area > 0.0), axis=1))
    depth = depth[reached]
    area = np.where(depth > 0.0, plates.area[reached], 0.0)
    x, z, c2, s2 = (part[reached] for part in (pose.x, pose.z, pose.c2, pose.s2))
    turning = plates.speed * plates.turns[reached]
    vx, vz = ahead + turning * z, up - turning * x
    pace = np.sqrt(vx * vx + vz * vz + v0 * v0)
    ux, uz = vx / pace, vz / pace

    skin = np.exp(-np.maximum(depth, 0.0) / SKIN)
    pressure = area * (plates.stiffness * depth + plates.offset * (1.0 - skin))
    pressure_gradient = area * (plates.stiffness + plates.offset / SKIN * skin)
    rest_x, rest_z, xx, xz, zx, zz = resistance_terms(c2, s2)
    sx, sz = rest_x - xx * ux - xz * uz, rest_z - zx * ux - zz * uz
    fx, fz = pressure * sx, pressure * sz
    turns = plates.turns[reached]
    # the motor works against the motion of the plates about the hub
    torque = -np.sum(turns * (fx * z - fz * x), axis=0)

    weight = pressure / pace
    ux_vx, ux_vz, uz_vz = (1.0 - ux * ux) * weight, -ux * uz * weight, (1.0 - uz * uz) * weight
    velocity_jacobian = -np.stack(
        [
            [np.sum(xx * ux_vx + xz * ux_vz, axis=0), np.sum(xx * ux_vz + xz * uz_vz, axis=0)],
            [np.sum(zx * ux_vx + zz * ux_vz, axis=0), np.sum(zx * ux_vz + zz * uz_vz, axis=0)],
        ]
    )
    height_derivative = -np.stack(
        [np.sum(pressure_gradient * sx, axis=0), np.sum(pressure_gradient * sz, axis=0)]
    )
    return GroundReaction(
        fx.sum(axis=0), fz.sum(axis=0), torque, velocity_jacobian, height_derivative
    )
