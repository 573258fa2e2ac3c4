"""Shear modulus and magnification from the two balances of a wheel on a slope."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.errors import FitError
from soilml.systems.force_sensor_wheel.sensor_model import SensingWheel
from soilml.systems.force_sensor_wheel.steady_run import Run, Strength
from soilml.systems.force_sensor_wheel.stress_profile import Floats, StressProfile
from soilml.systems.force_sensor_wheel.wheel_forces import Sheared, integrated

#: Shear moduli (m) looked at: from grip at once to none within any wheel's contact.
STIFFEST, SOFTEST = 1e-5, 10.0
LOOKS, ZOOMS = 32, 6


@dataclass(frozen=True)
class Balanced:
    """What satisfies both balances: true over measured stress M, and the shear modulus k_x (m)."""

    magnification: float
    shear_modulus: float


def solve(profile: StressProfile, at: Run, wheel: SensingWheel, strength: Strength) -> Balanced:
    r"""M and k_x from the two force balances on a slope.

    .. math::
        F_z(M, k_x) = m g \cos\alpha, \qquad F_x(M, k_x) = m g \sin\alpha

    F_z is a straight line in M, so that M follows from k_x outright; the pull left over is then
    looked at over all k_x, and the one interval in which it changes sign is narrowed. References:
    Nagatani et al. 2009, eqs. 11-15, who bisect twice. Without cohesion, and where angle on
    the rim and slope sum to less than a right angle, the pull left over crosses zero one way only,
    so that there is at most one answer; with cohesion, none of 3000 random arcs had two. Raises
    `FitError` where there is none, and which side that is, or more than one.
    """
    modulus = np.geomspace(STIFFEST, SOFTEST, LOOKS)
    left, magnification = excess(profile, at, wheel, strength, modulus)
    if not np.isfinite(left).any():
        raise FitError(
            "no magnification carries the weight at any shear modulus: cohesion alone carries "
            "more, or the shear of this braking wheel pulls it down; check cohesion and slip"
        )
    ends = _crossings(left)
    if len(ends) == 0:
        raise FitError(_one_sided(left, at))
    if len(ends) > 1:
        said = ", ".join(f"{modulus[i]:.2g} to {modulus[i + 1]:.2g}" for i in ends)
        raise FitError(
            f"{len(ends)} shear moduli satisfy both balances, in m: {said}; a run at another slip "
            "or slope is needed to choose"
        )
    i = int(ends[0])
    for _ in range(ZOOMS):
        modulus = np.geomspace(modulus[i], modulus[i + 1], LOOKS)
        left, magnification = excess(profile, at, wheel, strength, modulus)
        ends = _crossings(left)
        i = int(ends[0]) if len(ends) else 0  # rounding may hide the last of it
    return Balanced(float(magnification[i]), float(modulus[i]))


def excess(
    profile: StressProfile, at: Run, wheel: SensingWheel, strength: Strength, modulus: Floats
) -> tuple[Floats, Floats]:
    """Pull (N) beyond what the slope needs, and M, at some shear moduli (m); NaN without an M."""
    weight, slope = float(at.weight), float(at.slope)
    magnification, forces = carrying(profile, at, wheel, strength, modulus)
    return forces - weight * math.sin(slope), magnification


def carrying(
    profile: StressProfile, at: Run, wheel: SensingWheel, strength: Strength, modulus: Floats
) -> tuple[Floats, Floats]:
    """The M that carries the weight at some shear moduli (m), and the drawbar pull (N) then."""
    both = integrated(
        profile,
        Sheared(
            magnification=np.asarray([[0.0], [1.0]]),
            shear_modulus=modulus,
            cohesion=strength.cohesion,
            friction_angle=strength.friction_angle,
            slip=at.slip,
            radius=wheel.radius,
            width=wheel.width,
        ),
    )
    load, pull = both.load, both.drawbar_pull
    gain = load[1] - load[0]
    needed = float(at.weight) * math.cos(float(at.slope)) - load[0]
    possible = (gain > 0) & (needed > 0)
    magnification = np.where(possible, needed / np.where(possible, gain, 1.0), np.nan)
    return magnification, pull[0] + magnification * (pull[1] - pull[0])


def _crossings(left: Floats) -> NDArray[np.intp]:
    """The intervals in which the pull left over changes its sign."""
    known, above = np.isfinite(left), left > 0
    return np.flatnonzero((above[1:] != above[:-1]) & known[1:] & known[:-1])


def _one_sided(left: Floats, at: Run) -> str:
    """Why no shear modulus balances the pull."""
    needed = float(at.weight) * math.sin(float(at.slope))
    known = left[np.isfinite(left)]
    if known[0] < 0:
        return (
            f"even with perfect grip the wheel pulls {known.max() + needed:.3g} N, and the slope "
            f"needs {needed:.3g} N: the stress sits too far forward for this friction angle, slip "
            "and slope; check the zero of the angle, and that forward is positive"
        )
    return (
        f"even with hardly any grip the wheel pulls {known.min() + needed:.3g} N, and the slope "
        f"needs {needed:.3g} N: the stress sits too far back; check the zero of the angle, that "
        "forward is positive, and the sign of the slope"
    )
