"""Stress on a wheel's rim as a function of slip, fitted to profiles at several slips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError
from soilml.systems.rim_stress.climb import WheelRun
from soilml.systems.rim_stress.stress_profile import StressProfile

POINTS = 41  # Points from exit to entry that represent the shape of a profile
#: Slips closer than this count as one; highest degree of the polynomials in slip.
MIN_SLIP_DIFFERENCE, MAX_DEGREE = 0.05, 3
SAME_SIGMAS = 3.0  # Standard deviations within which two arcs count as equal


@dataclass(frozen=True)
class StressBySlip:
    r"""Exit, entry and shape of the stressed arc as polynomials of slip.

    Each profile is reduced to exit angle, entry angle and its shape at `POINTS` evenly spaced
    points, scaled to mean 1. Each of these numbers is fitted by a polynomial in slip, whose degree
    is the number of distinct slips less two, at least 1 and at most 3. Only the shape is kept,
    because the load of the wheel determines the magnitude. Valid from `lowest` to `highest` slip.
    References: Nagatani et al., section 5.2 and Figs. 5 and 7, which show that the stress at
    artificial slip on level ground equals that on a slope at the same slip.
    """

    slip: Floats  # (profiles,)
    fitted: Floats  # (profiles, 2 + POINTS)
    residual: Floats  # (profiles, 2 + POINTS), scaled by the degrees of freedom
    degree: int

    @classmethod
    def fit(cls, wheels: Sequence[WheelRun]) -> StressBySlip:
        """Fit profiles at two distinct slips or more; raises `FitError` for fewer."""
        slip = np.asarray([wheel.slip for wheel in wheels])
        distinct = _count_distinct(slip)
        if distinct < 2:
            raise FitError(
                f"stress at {distinct} slip{'s' if distinct != 1 else ''}; needed are two slips "
                f"that differ by {MIN_SLIP_DIFFERENCE} or more, for example artificial slips"
            )
        numbers = np.stack([_reduce(wheel.profile) for wheel in wheels])
        degree = int(np.clip(distinct - 2, 1, MAX_DEGREE))
        fitted = np.vander(slip, degree + 1) @ _fit_polynomials(slip, numbers, degree)
        freedom = max(len(slip) - degree - 1, 1)
        residual = (numbers - fitted) * np.sqrt(len(slip) / freedom)
        return cls(slip, fitted, residual, degree)

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
        coefficients = _fit_polynomials(self.slip, self.fitted, self.degree)
        profiles = []
        for numbers in np.vander(slips, self.degree + 1) @ coefficients:
            normal = np.maximum(numbers[2:], 0.0)
            normal[[0, -1]] = 0.0
            ends = numbers[0], max(numbers[1], numbers[0] + 1e-3)
            profiles.append(StressProfile(np.linspace(*ends, POINTS), normal))
        return profiles

    def resampled(self, rng: np.random.Generator) -> StressBySlip:
        """The fit to one residual bootstrap sample of the profiles."""
        chosen = rng.integers(len(self.slip), size=len(self.slip))
        return replace(self, fitted=self.fitted + self.residual[chosen])


def _reduce(profile: StressProfile) -> Floats:
    """Exit, entry and shape (2 + POINTS,)."""
    ends = profile.exit_angle, profile.entry_angle
    shape = np.interp(np.linspace(*ends, POINTS), profile.angle, profile.normal)
    return np.concatenate([ends, shape / shape.mean()])


def _fit_polynomials(slip: Floats, numbers: Floats, degree: int) -> Floats:
    """Least-squares coefficients (degree + 1, columns)."""
    return np.asarray(np.linalg.lstsq(np.vander(slip, degree + 1), numbers, rcond=None)[0])


def _count_distinct(slip: Floats) -> int:
    """Number of slips that differ by more than `MIN_SLIP_DIFFERENCE` from the previous one."""
    count, last = 0, -np.inf
    for value in np.sort(slip):
        if value - last > MIN_SLIP_DIFFERENCE:
            count, last = count + 1, float(value)
    return count


@dataclass(frozen=True)
class StressComparison:
    """Stressed arc on slopes less that at artificial slip on level ground, rad, and its std, (3,).

    difference, std: Of exit angle, entry angle and centre of the stress; means over `runs` profiles
        on slopes at slips within those on level ground.
    """

    difference: Floats
    std: Floats
    runs: int

    @property
    def equal(self) -> bool:
        """Whether no difference exceeds three standard deviations."""
        return bool((np.abs(self.difference) < SAME_SIGMAS * self.std).all())


def compare_stress(
    slopes: Sequence[WheelRun], level: Sequence[WheelRun]
) -> StressComparison | None:
    """Test whether stress at artificial slip on level ground equals that on slopes.

    The scatter is that of the profiles on level ground about their polynomial in slip. None without
    two slips on level ground, or without a slope within them. References: Nagatani et al., Fig. 7.
    """
    flat = np.asarray([wheel.slip for wheel in level])
    within = [w for w in slopes if len(flat) and flat.min() <= w.slip <= flat.max()]
    distinct = _count_distinct(flat)
    if distinct < 2 or not within:
        return None
    degree = int(np.clip(distinct - 2, 1, MAX_DEGREE))
    x = np.vander(flat, degree + 1)
    y, own = (np.stack([_ends_and_centre(w.profile) for w in runs]) for runs in (level, within))
    fit = np.linalg.lstsq(x, y, rcond=None)[0]
    variance = ((y - x @ fit) ** 2).sum(axis=0) / max(len(x) - degree - 1, 1)
    at = np.vander([w.slip for w in within], degree + 1)
    mean = at.mean(axis=0)
    share = 1.0 / len(within) + mean @ np.linalg.pinv(x.T @ x) @ mean
    return StressComparison(
        (own - at @ fit).mean(axis=0), np.sqrt(variance * share), runs=len(within)
    )


def _ends_and_centre(profile: StressProfile) -> Floats:
    centre = profile.angle @ profile.normal / profile.normal.sum()
    return np.asarray([profile.exit_angle, profile.entry_angle, centre])
