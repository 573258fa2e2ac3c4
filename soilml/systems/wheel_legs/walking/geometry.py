"""Legs and feet of a wheel-leg, cut into flat segments; the catalogue of feet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from soilml.arrays import Array
from soilml.errors import InputError

#: Most spokes that the model is meant for: contiguous feet must not share the soil under them.
MOST_LEGS = 6


@final
@dataclass(frozen=True)
class Section:
    """A strip of constant width and curvature: leg, tip or heel (Comin and Saaj 2017, fig. 4).

    `arc` is the height of the arc over its chord, positive to the right of who walks outwards from
    the hub along the leg and on along the foot: a leg bulges to the rear, a tip downwards and a
    heel upwards. So the heel of the CIF, -0.5 cm, is convex and its tip, -1 cm, concave, as the
    paper's text says.
    """

    segments: int
    width: float  # m
    length: float  # m, along the chord
    arc: float  # m

    def outline(self) -> tuple[Array, Array]:
        """Ends of the segments, (along, aside) the chord, (segments + 1,), m.

        Segments are equally long, chords of the arc.
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
    """What is fastened across the end of a leg: a tip ahead and a heel behind, or neither."""

    tip: Section | None = None
    heel: Section | None = None


#: Feet by name (Comin and Saaj 2017, table III): load testing, symmetric rubber, camel inspired.
FEET: dict[str, Foot] = {
    "none": Foot(),
    "LTF": Foot(tip=Section(20, 0.029, 0.04, 0.0055)),
    "SRF": Foot(tip=Section(10, 0.027, 0.025, 0.0), heel=Section(10, 0.027, 0.025, 0.0)),
    "CIF": Foot(tip=Section(13, 0.08, 0.065, -0.01), heel=Section(7, 0.05, 0.055, -0.005)),
}


@final
@dataclass(frozen=True)
class WheelLeg:
    """A rimless wheel of equal legs, and the share of the robot's body that it carries.

    Leg and body as simulated in the paper (table III). The body is a flat plate `clearance` below
    the hub: what the robot falls on where no leg carries it. The paper does not print it: both
    its numbers are assumed. An area of zero leaves it out.
    """

    foot: Foot = FEET["LTF"]
    legs: int = 5
    mass: float = 3.75  # kg
    speed: float = 0.3  # rad/s
    leg: Section = Section(10, 0.016, 0.18, 0.03)
    clearance: float = 0.02  # m, assumed
    body_area: float = 0.04  # m^2, assumed

    @property
    def flaw(self) -> str:
        """What makes it no wheel-leg, or nothing."""
        sections = [s for s in (self.leg, self.foot.tip, self.foot.heel) if s is not None]
        if self.legs not in range(1, MOST_LEGS + 1):
            return f"{self.legs} legs; the model is for 1 to {MOST_LEGS}"
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
        """All segments of all legs, the first leg straight down; then the body."""
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
    turns: Array  # 1 for what turns with the wheel, 0 for the body


def _plates(down: Array, forward: Array, width: float) -> tuple[Array, Array, Array, Array]:
    """(down, forward, area, tilt) of the segments between points of a leg that hangs straight."""
    fall, run = np.diff(down), np.diff(forward)
    middle_down, middle_forward = 0.5 * (down[1:] + down[:-1]), 0.5 * (forward[1:] + forward[:-1])
    return middle_down, middle_forward, width * np.hypot(fall, run), np.arctan2(-fall, run)


def wheel_leg(foot: str = "LTF", **changes: Any) -> WheelLeg:
    """The paper's wheel-leg with the foot of that name, and other fields of `WheelLeg` replaced.

    Raises `InputError` for a foot that is not in `FEET`, and for a wheel-leg that cannot be.
    """
    if foot not in FEET:
        raise InputError(f"no foot {foot!r}; there are: {', '.join(FEET)}")
    made = replace(WheelLeg(foot=FEET[foot]), **changes)
    if made.flaw:
        raise InputError(f"not a wheel-leg: {made.flaw}")
    return made
