"""How the stress on a wheel's rim changes with slip, from profiles measured at some slips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.errors import FitError
from soilml.systems.climbing.climb import WheelRun
from soilml.systems.force_sensor_wheel import StressProfile

Floats = NDArray[np.float64]

#: Points from exit to entry at which the shape of a profile is taken.
POINTS = 41
#: Slips nearer than this count as one; the highest power of slip.
APART, POWER = 0.05, 3


@dataclass(frozen=True)
class StressBySlip:
    r"""Exit, entry and shape of the stressed arc as polynomials of slip.

    Each profile becomes (exit, entry, shape at `POINTS` places evenly between them, mean 1), and
    each of these numbers a polynomial of slip by least squares: its power is two less than the
    slips that differ, at least 1 and at most 3. Only the shape is kept, for the load of the wheel
    sets its height. Nothing is said of slips below `lowest` or above `highest`. References:
    Nagatani et al., section 5.2 and Figs. 5 and 7, where the stress at artificial slip on the flat
    is found to be that on a slope at the same slip.
    """

    slip: Floats  # (profiles,)
    fitted: Floats  # (profiles, 2 + POINTS)
    residual: Floats  # (profiles, 2 + POINTS), of the size that the fit has not taken up
    power: int

    @classmethod
    def of(cls, wheels: Sequence[WheelRun]) -> StressBySlip:
        """From profiles at two slips or more; raises `FitError` for fewer."""
        slip = np.asarray([wheel.slip for wheel in wheels])
        differ = _differing(slip)
        if differ < 2:
            raise FitError(
                f"stress at {differ} slip{'s' if differ != 1 else ''}; needed are two slips that "
                f"differ by {APART} or more, such as artificial slips on the flat"
            )
        numbers = np.stack([_reduced(wheel.profile) for wheel in wheels])
        power = int(np.clip(differ - 2, 1, POWER))
        fitted = np.vander(slip, power + 1) @ _solved(slip, numbers, power)
        freedom = max(len(slip) - power - 1, 1)
        residual = (numbers - fitted) * np.sqrt(len(slip) / freedom)
        return cls(slip, fitted, residual, power)

    @property
    def lowest(self) -> float:
        """The smallest slip at which stress was measured."""
        return float(self.slip.min())

    @property
    def highest(self) -> float:
        """The largest slip at which stress was measured."""
        return float(self.slip.max())

    def profiles(self, slips: Floats) -> list[StressProfile]:
        """The stress at slips (n,), of mean about 1 Pa; raises `FitError` outside the range."""
        if len(slips) and not self.lowest <= np.min(slips) <= np.max(slips) <= self.highest:
            raise FitError(
                f"slips {np.min(slips):.3g} to {np.max(slips):.3g}: stress was measured from "
                f"{self.lowest:.3g} to {self.highest:.3g} only"
            )
        solved = _solved(self.slip, self.fitted, self.power)
        found = []
        for numbers in np.vander(slips, self.power + 1) @ solved:
            normal = np.maximum(numbers[2:], 0.0)
            normal[[0, -1]] = 0.0
            ends = numbers[0], max(numbers[1], numbers[0] + 1e-3)
            found.append(StressProfile(np.linspace(*ends, POINTS), normal))
        return found

    def redrawn(self, rng: np.random.Generator) -> StressBySlip:
        """As other profiles with the same scatter would have given it (residual bootstrap)."""
        chosen = rng.integers(len(self.slip), size=len(self.slip))
        return replace(self, fitted=self.fitted + self.residual[chosen])


def _reduced(profile: StressProfile) -> Floats:
    """Exit, entry and shape (2 + POINTS,)."""
    ends = profile.exit_angle, profile.entry_angle
    shape = np.interp(np.linspace(*ends, POINTS), profile.angle, profile.normal)
    return np.concatenate([ends, shape / shape.mean()])


def _solved(slip: Floats, numbers: Floats, power: int) -> Floats:
    """Coefficients (power + 1, columns) of least squares."""
    return np.asarray(np.linalg.lstsq(np.vander(slip, power + 1), numbers, rcond=None)[0])


def _differing(slip: Floats) -> int:
    """How many slips differ by more than `APART` from the one before."""
    count, last = 0, -np.inf
    for value in np.sort(slip):
        if value - last > APART:
            count, last = count + 1, float(value)
    return count
