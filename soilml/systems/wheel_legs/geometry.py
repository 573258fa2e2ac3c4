"""Legs and feet of a wheel-leg, cut into flat segments; the catalogue of feet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from soilml.arrays import Array
from soilml.errors import InputError

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
    width: float  # m
    length: float  # m, along the chord
    arc: float  # m

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


@final
@dataclass(frozen=True)
class Foot:
    """A foot across the end of a leg: a tip in front and a heel behind, or neither."""

    tip: Section | None = None
    heel: Section | None = None


#: Feet by name (Comin and Saaj 2017, table III): Load Testing Foot, Symmetric Rubber Foot, Camel
#: Inspired Foot. The arc of the LTF is taken as symmetric about its chord, of radius 3.9 cm; in
#: midstance (`stances.FOOT`) the same print is taken as an arc that leaves the leg level, 14.8 cm.
FEET: dict[str, Foot] = {
    "none": Foot(),
    "LTF": Foot(tip=Section(20, 0.029, 0.04, 0.0055)),
    "SRF": Foot(tip=Section(10, 0.027, 0.025, 0.0), heel=Section(10, 0.027, 0.025, 0.0)),
    "CIF": Foot(tip=Section(13, 0.08, 0.065, -0.01), heel=Section(7, 0.05, 0.055, -0.005)),
}


@final
@dataclass(frozen=True)
class WheelLeg:
    """A rimless wheel of equal legs, and the part of the robot's body that it carries.

    Leg and mass as simulated in the paper (table III). The body is a flat plate `clearance` below
    the hub that supports the robot where no leg does. Its clearance and area are not printed and
    are assumed; an area of zero omits it.
    """

    foot: Foot = FEET["LTF"]
    legs: int = 5
    mass: float = 3.75  # kg
    speed: float = 0.3  # rad/s
    leg: Section = Section(10, 0.016, 0.18, 0.03)
    clearance: float = 0.02  # m, assumed
    body_area: float = 0.04  # m^2, assumed

    @property
    def invalid_reason(self) -> str:
        """Why the wheel-leg is invalid; empty if it is valid."""
        sections = [s for s in (self.leg, self.foot.tip, self.foot.heel) if s is not None]
        if self.legs not in range(1, MAX_LEGS + 1):
            return f"{self.legs} legs; the model is for 1 to {MAX_LEGS}"
        if not 0.0 < self.mass < np.inf:
            return f"a mass of {self.mass:g} kg; it must be positive"
        if not 0.0 < self.speed < np.inf:
            return f"a speed of {self.speed:g} rad/s; it must be positive, forwards"
        if not all(s.segments >= 1 and s.width > 0 and s.length > 0 for s in sections):
            return "a section without segments, width or length"
        if not all(np.isfinite([s.width, s.length, s.arc]).all() for s in sections):
            return "a section of no finite size"
        if not (self.clearance >= 0.0 and self.body_area >= 0.0):
            return "a body above the hub or of negative area"
        return ""

    def plates(self) -> Plates:
        """All segments of all legs, the first leg pointing straight down; the body is last."""
        along, aside = self.leg.outline()
        parts = [_plates(along, -aside, self.leg.width)]
        for section, ahead in ((self.foot.tip, 1.0), (self.foot.heel, -1.0)):
            if section is not None:
                forward, right = section.outline()
                down = self.leg.length + ahead * right
                parts.append(_plates(down, ahead * forward, section.width))
        down, forward, area, tilt = (np.concatenate(part) for part in zip(*parts, strict=True))
        turn = 2.0 * np.pi * np.arange(self.legs)[:, None] / self.legs
        x = np.sin(turn) * down + np.cos(turn) * forward
        z = np.sin(turn) * forward - np.cos(turn) * down
        return Plates(
            x=np.append(x, 0.0),
            z=np.append(z, -self.clearance),
            area=np.append(np.tile(area, self.legs), self.body_area),
            tilt=np.append(turn + tilt, 0.0),
            turns=np.append(np.ones(x.size), 0.0),
        )


@dataclass(frozen=True)
class Plates:
    """Flat segments about the hub: centre (x, z), m, area, m^2, tilt, rad; arrays (plates,)."""

    x: Array
    z: Array
    area: Array
    tilt: Array  # from the direction of travel, anticlockwise
    turns: Array  # 1 for plates that turn with the wheel, 0 for the body


def _plates(down: Array, forward: Array, width: float) -> tuple[Array, Array, Array, Array]:
    """(down, forward, area, tilt) of the segments between points of a vertical leg."""
    fall, run = np.diff(down), np.diff(forward)
    middle_down, middle_forward = 0.5 * (down[1:] + down[:-1]), 0.5 * (forward[1:] + forward[:-1])
    return middle_down, middle_forward, width * np.hypot(fall, run), np.arctan2(-fall, run)


def wheel_leg(foot: str = "LTF", **changes: Any) -> WheelLeg:
    """The paper's wheel-leg with a named foot and other fields of `WheelLeg` replaced.

    Parameters
    ----------
    foot
        Name of a foot in `FEET`.
    **changes
        Fields of `WheelLeg`, for example `legs=3, mass=2.0`.

    Raises
    ------
    InputError
        For an unknown foot, and for an invalid wheel-leg.

    Examples
    --------
    >>> wheel_leg("CIF", legs=3).plates().x.shape  # 10 + 13 + 7 segments of each leg, and the body
    (91,)
    """
    if foot not in FEET:
        raise InputError(f"no foot {foot!r}; there are: {', '.join(FEET)}")
    made = replace(WheelLeg(foot=FEET[foot]), **changes)
    if made.invalid_reason:
        raise InputError(f"invalid wheel-leg: {made.invalid_reason}")
    return made
