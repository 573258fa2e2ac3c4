r"""Stress of granular ground on a thin plate that moves through it: resistive-force theory.

Signs. The plate is inclined at the *attack* angle beta from the horizontal, positive if its leading
end is raised, and moves at the *intrusion* angle gamma below the
horizontal: gamma = pi/2 is straight down. With alpha_x and alpha_z the stress per depth,

.. math:: \sigma_x = -\alpha_x z \;\text{(against the travel)}, \qquad \sigma_z = \alpha_z z \;
    \text{(upwards)}

The law describes a thin plate, both faces together, without distinguishing a leading face. A plate
being withdrawn is resisted by a quarter of the stress at intrusion, and a resting plate is
supported by the part that does not depend on the motion.

References: Li, Zhang and Goldman, Science 339, 2013; Comin and Saaj 2017, eqs. 4 to 6, table II.
The paper's eq. 5 prints cosines throughout; the terms of B and D are sines. Measured for dry,
loosely packed grains, slow motion (no inertia of the grains) and plates near the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Any, final

import numpy as np

from soilml.arrays import Array
from soilml.errors import InputError
from soilml.parameters import Parameter, check

#: Coefficients of the generic granular medium, scaled so that alpha_z(0, pi/2) = 1; by (k, l).
A = {(0, 0): 0.206, (1, 0): 0.169}
B = {(1, 1): 0.212, (0, 1): 0.358, (-1, 1): 0.055}
C = {(1, 1): -0.124, (0, 1): 0.253, (-1, 1): 0.007}
D = {(1, 0): 0.088}


def resistance_terms(c2: Array, s2: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
    r"""Stress per depth on plates, forward and upward, for the generic medium, in six terms.

    .. math::
        \alpha_z = \sum_{k,l} [A_{kl} \cos(2k\beta + l\gamma) + B_{kl} \sin(2k\beta + l\gamma)]

        (\sigma_x, \sigma_z) / z = (-\alpha_x, \alpha_z) = \sigma_{rest}(\beta) - R(\beta) \hat v

    and alpha_x with C and D (Comin and Saaj 2017, eq. 5, with sines). Static part (x, z) and matrix
    R (xx, xz, zx, zz) at cos 2 beta and sin 2 beta, beta anticlockwise from the direction of travel
    x; v is the direction of motion, a unit vector with z upwards, so that no angle is wrapped.
    """
    return (
        -D[1, 0] * s2,
        A[0, 0] + A[1, 0] * c2,
        C[0, 1] + (C[1, 1] + C[-1, 1]) * c2,
        (C[1, 1] - C[-1, 1]) * s2,
        (B[-1, 1] - B[1, 1]) * s2,
        B[0, 1] + (B[1, 1] + B[-1, 1]) * c2,
    )


LUMPED_AT = 0.01  # Depth at which the paper states the normal stiffness sigma_1, m


@final
@dataclass(frozen=True, kw_only=True)
class LinearGround:
    r"""Normal stress under a flat plate pushed straight down, in SI.

    .. math:: \sigma(z) = \sigma_0 + \alpha_z z, \qquad \sigma_1 = \sigma_0 + \alpha_z \cdot 1 cm

    References: Comin and Saaj 2017, eq. 3 and table I. Walks are by resistive-force theory, eq. 4,
    which has no offset: its stress is proportional to depth.
    """

    stiffness: Annotated[float, Parameter("N/m^3", 1.0, 1e9, "alpha_z(0, pi/2)")]
    offset: Annotated[float, Parameter("Pa", 0.0, 1e7, "sigma_0, stress at the surface")] = 0.0
    friction_angle: Annotated[float, Parameter("rad", 0.0, 1.4, "phi; not used in walking")] = 0.6

    def __post_init__(self) -> None:
        check(self, "ground: ")

    @property
    def normal_stiffness(self) -> float:
        """sigma_1, the normal stress one centimetre deep, Pa."""
        return self.offset + self.stiffness * LUMPED_AT


#: The four soils of the tests, prepared by raking (Comin and Saaj 2017, table I).
GROUNDS: dict[str, LinearGround] = {
    "SSC-1": LinearGround(stiffness=0.29e6, offset=8400.0, friction_angle=0.7381),
    "SSC-2": LinearGround(stiffness=1.05e6, offset=13100.0, friction_angle=0.746477),
    "SSC-3": LinearGround(stiffness=0.70e6, offset=2900.0, friction_angle=0.507891),
    "ES-3": LinearGround(stiffness=1.70e6, offset=5000.0, friction_angle=0.625351),
}


MAX_LEGS = 6  # Largest number of legs: neighbouring feet must not load the same soil


@final
@dataclass(frozen=True)
class Section:
    """A strip of constant width and curvature: leg, tip or heel (Comin and Saaj 2017, fig. 4).

    `arc` is the height of the arc over its chord, positive to the right on the way from the hub
    along the leg and the foot. A leg bulges to the rear, a tip downwards and a heel upwards. The
    heel of the CIF, -0.5 cm, is thus convex and its tip, -1 cm, concave, as stated in the paper.
    """

    segments: int
    width: Annotated[float, Parameter("m", 1e-6, 10.0)]
    length: Annotated[float, Parameter("m", 1e-6, 10.0, "along the chord")]
    arc: Annotated[float, Parameter("m", -10.0, 10.0)]

    def outline(self) -> tuple[Array, Array]:
        """End points of the segments along and normal to the chord, (segments + 1,), m.

        The segments are chords of the arc, equally long.
        """
        chord, bulge = self.length, self.arc
        if abs(bulge) < 1e-9:
            return np.linspace(0.0, chord, self.segments + 1), np.zeros(self.segments + 1)
        radius = (0.25 * chord**2 + bulge**2) / (2.0 * abs(bulge))
        half = 2.0 * np.arctan2(2.0 * abs(bulge), chord)
        angle = np.linspace(-half, half, self.segments + 1)
        along = 0.5 * chord + radius * np.sin(angle)
        return along, np.sign(bulge) * radius * (np.cos(angle) - np.cos(half))


#: Feet by name: a tip ahead of the end of a leg and a heel behind it, or neither (Comin and Saaj
#: 2017, table III): Load Testing Foot, Symmetric Rubber Foot, Camel Inspired Foot. The arc of the
#: LTF is taken as symmetric about its chord, of radius 3.9 cm; in midstance the same print is taken
#: as an arc that leaves the leg level, 14.8 cm (`soilml.papers.comin2017_slip.FOOT`).
FEET: dict[str, tuple[Section | None, Section | None]] = {
    "none": (None, None),
    "LTF": (Section(20, 0.029, 0.04, 0.0055), None),
    "SRF": (Section(10, 0.027, 0.025, 0.0), Section(10, 0.027, 0.025, 0.0)),
    "CIF": (Section(13, 0.08, 0.065, -0.01), Section(7, 0.05, 0.055, -0.005)),
}


@final
@dataclass(frozen=True)
class WheelLeg:
    """A rimless wheel of equal legs, and the part of the robot's body that it carries.

    Leg and mass as simulated in the paper (table III). The body is a flat plate `clearance` below
    the hub that supports the robot where no leg does. Its clearance and area are not printed and
    are assumed; an area of zero omits it.
    """

    foot: tuple[Section | None, Section | None] = FEET["LTF"]
    legs: int = 5
    mass: Annotated[float, Parameter("kg", 1e-6, 1e6)] = 3.75
    speed: Annotated[float, Parameter("rad/s", 1e-6, 1e3, "forwards")] = 0.3
    leg: Section = Section(10, 0.016, 0.18, 0.03)
    clearance: Annotated[float, Parameter("m", 0.0, 10.0, "assumed")] = 0.02
    body_area: Annotated[float, Parameter("m^2", 0.0, 10.0, "assumed")] = 0.04

    def __post_init__(self) -> None:
        """Raise `InputError` for sizes out of bounds, and for too many legs."""
        check(self, "wheel-leg: ")
        if self.legs not in range(1, MAX_LEGS + 1):
            raise InputError(f"{self.legs} legs; the model is for 1 to {MAX_LEGS}")

    def plates(self) -> Array:
        """Flat segments of all legs, the first of which points straight down, and the body, last.

        Rows (5, plates): centre x and z about the hub (m), area (m^2), tilt from the direction of
        travel, anticlockwise (rad), and 1 for plates that turn with the wheel, 0 for the body.
        """
        along, aside = self.leg.outline()
        parts = [_segments(along, -aside, self.leg.width)]
        for section, ahead in zip(self.foot, (1.0, -1.0), strict=True):
            if section is not None:
                forward, right = section.outline()
                down = self.leg.length + ahead * right
                parts.append(_segments(down, ahead * forward, section.width))
        down, forward, area, tilt = np.concatenate(parts, axis=1)
        turn = 2.0 * np.pi * np.arange(self.legs)[:, None] / self.legs
        x = np.sin(turn) * down + np.cos(turn) * forward
        z = np.sin(turn) * forward - np.cos(turn) * down
        legs = [x, z, np.tile(area, (self.legs, 1)), turn + tilt, np.ones_like(x)]
        body = [[0.0], [-self.clearance], [self.body_area], [0.0], [0.0]]
        return np.hstack([np.stack(legs).reshape(5, -1), body])


def _segments(down: Array, forward: Array, width: float) -> Array:
    """(down, forward, area, tilt) of the segments between points of a vertical leg, (4, n)."""
    fall, run = np.diff(down), np.diff(forward)
    middle_down, middle_forward = 0.5 * (down[1:] + down[:-1]), 0.5 * (forward[1:] + forward[:-1])
    area = width * np.hypot(fall, run)
    return np.stack([middle_down, middle_forward, area, np.arctan2(-fall, run)])


def wheel_leg(foot: str = "LTF", **changes: Any) -> WheelLeg:
    """The paper's wheel-leg with a foot of `FEET`, and other fields of `WheelLeg` replaced.

    Raises `InputError` for an unknown foot, and for an invalid wheel-leg.
    """
    if foot not in FEET:
        raise InputError(f"no foot {foot!r}; there are: {', '.join(FEET)}")
    return WheelLeg(foot=FEET[foot], **changes)


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
    mass: Array  # kg
    tip_speed: Array  # m/s, of the leg's end about the hub
    legs: Array
    slip: Array  # commanded; NaN where the wheel rolls freely

    @staticmethod
    def of(wheels: Sequence[WheelLeg], grounds: Sequence[LinearGround], slip: Array) -> WalkingLegs:
        """Stack the plates of all cases, padded with plates of zero area."""
        plates = [wheel.plates() for wheel in wheels]
        most = max(own.shape[1] for own in plates)
        x, z, area, tilt, turns = np.stack(
            [np.pad(own, ((0, 0), (0, most - own.shape[1]))) for own in plates], axis=-1
        )
        return WalkingLegs(
            x=x,
            z=z,
            area=area,
            c2=np.cos(2.0 * tilt),
            s2=np.sin(2.0 * tilt),
            turns=turns,
            speed=np.array([w.speed for w in wheels], float),
            stiffness=np.array([g.stiffness for g in grounds], float),
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
        gradient = area * self.stiffness
        pressure = gradient * depth
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
