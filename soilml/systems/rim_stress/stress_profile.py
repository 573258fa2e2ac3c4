"""Normal stress along the rim of a wheel, as measured."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.numerics.quadrature import gauss

#: Gauss points between two samples: there the stress is linear in the angle, the shear
#: displacement is not.
BETWEEN = 3


@final
@dataclass(frozen=True)
class StressProfile:
    """Normal stress against the angle on the rim, linear between samples.

    Valid where the stress is uniform over the width, or `normal` is its mean. Samples may extend
    beyond the stressed arc, where they are zero.

    Parameters
    ----------
    angle
        Contact angle (p,), rad from straight down, positive forward, increasing; p at least 3.
    normal
        Normal stress (p,), Pa, not negative.

    Raises
    ------
    InputError
        For other shapes, angles that do not increase, values that are not finite, negative stress,
        no contact, or stress above the axle.

    References
    ----------
    Nagatani et al. 2009, section IV.

    Examples
    --------
    >>> import numpy as np
    >>> profile = StressProfile(np.linspace(-0.2, 0.4, 7), np.array([0, 0, 4e3, 9e3, 7e3, 2e3, 0]))
    >>> round(profile.exit_angle, 2), round(profile.peak_angle, 2), round(profile.entry_angle, 2)
    (-0.1, 0.1, 0.4)
    """

    angle: Floats
    normal: Floats

    def __post_init__(self) -> None:
        for name in ("angle", "normal"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=np.float64))
        _refuse(self.angle, self.normal)

    @cached_property
    def exit_angle(self) -> float:
        """Exit angle, at which the stress ends in the rear contact, rad."""
        first = int(np.flatnonzero(self.normal > 0)[0])
        return float(self.angle[max(first - 1, 0)])

    @cached_property
    def entry_angle(self) -> float:
        """Entry angle, at which stress and shear displacement begin in front, rad."""
        last = int(np.flatnonzero(self.normal > 0)[-1])
        return float(self.angle[min(last + 1, len(self.angle) - 1)])

    @cached_property
    def peak_angle(self) -> float:
        """Angle of the maximum stress, rad."""
        return float(self.angle[int(np.argmax(self.normal))])

    @cached_property
    def nodes(self) -> tuple[Floats, Floats, Floats]:
        """Quadrature angles (q,), their weights (rad) and the stress there (Pa), exit to entry."""
        inside = (self.angle >= self.exit_angle) & (self.angle <= self.entry_angle)
        angle, normal = self.angle[inside], self.normal[inside]
        share, weight = gauss(BETWEEN)
        step = np.diff(angle)[:, None]
        at = (angle[:-1, None] + step * share).ravel()
        return at, (step * weight).ravel(), np.interp(at, angle, normal)


def _refuse(angle: Floats, normal: Floats) -> None:
    """Raise `InputError` for an invalid profile."""
    if angle.ndim != 1 or angle.shape != normal.shape:
        raise InputError(
            f"a stress profile has angles of shape {angle.shape} and stresses of shape "
            f"{normal.shape}; both must be (points,)"
        )
    if len(angle) < 3:
        raise InputError(f"a stress profile of {len(angle)} points; three or more are needed")
    if not (np.isfinite(angle).all() and np.isfinite(normal).all()):
        raise InputError(
            "a stress profile contains values that are not finite; leave such samples out"
        )
    if (farthest := float(np.abs(angle).max())) > math.pi + 1e-9:
        raise InputError(
            f"a stress profile reaches to {farthest:g} rad, more than half a turn; angles are in "
            "radians from straight down (np.deg2rad turns degrees into them)"
        )
    if not (np.diff(angle) > 0).all():
        raise InputError("the angles of a stress profile must increase from one sample to the next")
    if (least := float(normal.min())) < 0:
        raise InputError(
            f"a stress profile contains {least:g} Pa; soil does not pull at a rim, so subtract the "
            "sensor's zero and set remaining negative values to 0"
        )
    stressed = angle[normal > 0]
    if len(stressed) == 0:
        raise InputError("a stress profile without contact: every stress is zero")
    if float(np.abs(stressed).max()) >= 0.5 * math.pi:
        raise InputError(
            f"a stress profile has stress at {float(stressed[np.abs(stressed).argmax()]):.3g} rad, "
            "above the axle; angles are from straight down, positive forward"
        )
