"""Force of the ground on a batch of wheel-legs, and how it changes with their motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from soilml.arrays import Array
from soilml.systems.wheel_legs.walking.geometry import WheelLeg
from soilml.systems.wheel_legs.walking.linear_ground import Ground
from soilml.systems.wheel_legs.walking.resistive_force import resistance_terms

#: Depth over which the offset of the normal stress builds up, m: no plate is struck at once.
SKIN = 0.001


@dataclass(frozen=True)
class Batch:
    """Plates of every case before the wheel turns, (plates, cases), and the ground of each."""

    x: Array  # m
    z: Array  # m
    area: Array  # m^2; 0 fills up cases with fewer plates
    c2: Array  # cos and sin of twice the tilt
    s2: Array
    turns: Array  # 1 for what turns with the wheel, 0 for the body
    speed: Array  # rad/s, (cases,)
    stiffness: Array  # N/m^3, (cases,)
    offset: Array  # Pa, (cases,)

    def of(self, cases: Array) -> Batch:
        """Some of the cases."""
        return Batch(**{f.name: getattr(self, f.name)[..., cases] for f in fields(Batch)})

    def at(self, angle: float) -> Pose:
        """The plates after the wheel has turned by `angle`, rad, forwards."""
        c, s = np.cos(angle * self.turns), np.sin(angle * self.turns)
        double_c, double_s = c * c - s * s, 2.0 * c * s
        return Pose(
            x=self.x * c + self.z * s,
            z=self.z * c - self.x * s,
            c2=self.c2 * double_c + self.s2 * double_s,
            s2=self.s2 * double_c - self.c2 * double_s,
        )


@dataclass(frozen=True)
class Pose:
    """Plates relative to the hub at one instant, (plates, cases)."""

    x: Array
    z: Array
    c2: Array
    s2: Array


@dataclass(frozen=True)
class Reaction:
    """What the ground does to the hub of every case, (cases,), and how that changes."""

    ahead: Array  # N
    up: Array  # N
    torque: Array  # N m, what the motor must give to keep the wheel turning
    slopes: Array  # N s/m, (2, 2, cases): force (ahead, up) by hub velocity (x, z)
    sinking: Array  # N/m, (2, cases): force by hub height


def batch(wheel_legs: Sequence[WheelLeg], grounds: Sequence[Ground]) -> Batch:
    """Plates side by side, padded to the longest case with plates of no area."""
    plates = [wheel_leg.plates() for wheel_leg in wheel_legs]
    most = max(p.x.size for p in plates)

    def padded(name: str) -> Array:
        columns = [np.asarray(getattr(p, name), float) for p in plates]
        return np.stack([np.pad(c, (0, most - c.size)) for c in columns], axis=1)

    tilt = padded("tilt")
    return Batch(
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


def reaction(
    given: Batch, pose: Pose, height: Array, ahead: Array, up: Array, v0: Array
) -> Reaction:
    r"""Sum of the stresses of all plates (Comin and Saaj 2017, eq. 7).

    `height`, `ahead`, `up`: height (m) and velocity (m/s) of the hub, (cases,). Stress depends on
    the direction of motion, not on its speed; below about `v0` (m/s) the direction fades,

    .. math:: \hat v \to v / \sqrt{v^2 + v_0^2}

    or a foot that stands still would be thrown about by the step of the integration.
    """
    depth = -(pose.z + height)
    reached = np.flatnonzero(np.any((depth > 0.0) & (given.area > 0.0), axis=1))
    depth = depth[reached]
    area = np.where(depth > 0.0, given.area[reached], 0.0)
    x, z, c2, s2 = (part[reached] for part in (pose.x, pose.z, pose.c2, pose.s2))
    turning = given.speed * given.turns[reached]
    vx, vz = ahead + turning * z, up - turning * x
    pace = np.sqrt(vx * vx + vz * vz + v0 * v0)
    ux, uz = vx / pace, vz / pace

    skin = np.exp(-np.maximum(depth, 0.0) / SKIN)
    pressure = area * (given.stiffness * depth + given.offset * (1.0 - skin))
    deeper = area * (given.stiffness + given.offset / SKIN * skin)
    rest_x, rest_z, xx, xz, zx, zz = resistance_terms(c2, s2)
    sx, sz = rest_x - xx * ux - xz * uz, rest_z - zx * ux - zz * uz
    fx, fz = pressure * sx, pressure * sz
    turned = given.turns[reached]
    # the motor works against the motion of the plates about the hub
    torque = -np.sum(turned * (fx * z - fz * x), axis=0)

    weight = pressure / pace
    ux_vx, ux_vz, uz_vz = (1.0 - ux * ux) * weight, -ux * uz * weight, (1.0 - uz * uz) * weight
    slopes = -np.stack(
        [
            [np.sum(xx * ux_vx + xz * ux_vz, axis=0), np.sum(xx * ux_vz + xz * uz_vz, axis=0)],
            [np.sum(zx * ux_vx + zz * ux_vz, axis=0), np.sum(zx * ux_vz + zz * uz_vz, axis=0)],
        ]
    )
    sinking = -np.stack([np.sum(deeper * sx, axis=0), np.sum(deeper * sz, axis=0)])
    return Reaction(fx.sum(axis=0), fz.sum(axis=0), torque, slopes, sinking)
