"""Stress on a rim against slip, and the pull and steepest slope of a rover that follow from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats, Real
from soilml.errors import FitError
from soilml.systems.rim_stress.climbs import Rover, WheelRun, count_apart
from soilml.systems.rim_stress.ground import GroundEstimate
from soilml.systems.rim_stress.stress import StressProfile

POINTS = 41  # Points from exit to entry that represent the shape of a profile
#: Slips closer than this count as one; highest degree of the polynomials in slip.
MIN_SLIP_DIFFERENCE, MAX_DEGREE = 0.05, 3
SAME_SIGMAS = 3.0  # Standard deviations within which two arcs count as equal
#: Points of the curve over slip; resamples of the measured stress; soil samples taken with each
#: resample. Forces are computed for all soils of a resample at once: 24 x 16 samples determine the
#: ends of a 90 % interval to about 1.5 % of probability.
CURVE_SLIPS, STRESS_RESAMPLES, SOILS_PER_RESAMPLE = 25, 24, 16


@dataclass(frozen=True)
class StressBySlip:
    r"""Exit, entry and shape of the stressed arc as polynomials of slip.

    Each profile is reduced to exit angle, entry angle and its shape at `POINTS` evenly spaced
    points, scaled to mean 1. Each of these numbers is fitted by a polynomial in slip, whose degree
    is the number of distinct slips less two, at least 1 and at most 3. Only the shape is kept,
    because the load of the wheel determines the magnitude. Valid within the slips measured.
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
        distinct = count_apart(slip, MIN_SLIP_DIFFERENCE)
        if distinct < 2:
            raise FitError(
                f"stress at {distinct} slip{'s' if distinct != 1 else ''}; needed are two slips "
                f"that differ by {MIN_SLIP_DIFFERENCE} or more, for example artificial slips"
            )
        numbers = np.stack([_reduce(wheel.profile) for wheel in wheels])
        degree = int(np.clip(distinct - 2, 1, MAX_DEGREE))
        own = cls(slip, numbers, numbers, degree)
        fitted = own.numbers(slip)
        freedom = max(len(slip) - degree - 1, 1)
        return cls(slip, fitted, (numbers - fitted) * np.sqrt(len(slip) / freedom), degree)

    def numbers(self, slips: Floats) -> Floats:
        """Exit, entry and shape (n, 2 + POINTS) at slips (n,), by least squares."""
        x = np.vander(self.slip, self.degree + 1)
        found = np.linalg.lstsq(x, self.fitted, rcond=None)[0]
        return np.asarray(np.vander(slips, self.degree + 1) @ found)

    def profiles(self, slips: Floats) -> list[StressProfile]:
        """The stress at slips (n,) within the range, of mean about 1 Pa."""
        profiles = []
        for numbers in self.numbers(slips):
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
    flat = [wheel.slip for wheel in level]
    within = [w for w in slopes if flat and min(flat) <= w.slip <= max(flat)]
    if count_apart(flat, MIN_SLIP_DIFFERENCE) < 2 or not within:
        return None
    fit = StressBySlip.fit(level)
    slips = np.asarray([wheel.slip for wheel in within])
    own, expected = (
        _ends_and_centre(numbers)
        for numbers in (np.stack([_reduce(w.profile) for w in within]), fit.numbers(slips))
    )
    x, at = (np.vander(slip, fit.degree + 1) for slip in (fit.slip, slips))
    scatter = _ends_and_centre(fit.fitted + fit.residual) - _ends_and_centre(fit.fitted)
    mean = at.mean(axis=0)
    share = 1.0 / len(within) + mean @ np.linalg.pinv(x.T @ x) @ mean
    std = np.sqrt((scatter**2).mean(axis=0) * share)
    return StressComparison((own - expected).mean(axis=0), std, runs=len(within))


def _ends_and_centre(numbers: Floats) -> Floats:
    """Exit, entry and centre of the stress (n, 3), of profiles as `_reduce` has them."""
    shape = numbers[:, 2:]
    place = shape @ np.linspace(0.0, 1.0, POINTS) / shape.sum(axis=1)
    centre = numbers[:, 0] + place * (numbers[:, 1] - numbers[:, 0])
    return np.column_stack([numbers[:, :2], centre])


@dataclass(frozen=True)
class ClimbingAbility:
    """Predicted pull and slope over the slips at which stress was measured."""

    slip: Floats  # (n,)
    pull: Floats  # (samples, n), N, drawbar pull of the rover on level ground
    slope: Floats  # (samples, n), rad, climbed steadily at each slip

    @property
    def steepest(self) -> Floats:
        """The steepest slope of each sample, rad (samples,)."""
        return np.asarray(self.slope.max(axis=1))

    @property
    def steepest_slip(self) -> Floats:
        """The slip at which each sample climbs its steepest slope (samples,)."""
        return np.asarray(self.slip[np.argmax(self.slope, axis=1)])

    @property
    def fraction_still_rising(self) -> float:
        """Fraction of samples whose slope is largest at the highest slip, where the curve ends."""
        return float(np.mean(np.argmax(self.slope, axis=1) == len(self.slip) - 1))


def climbing_ability(
    ground: GroundEstimate, front: StressBySlip, rear: StressBySlip, *, seed: int = 0
) -> ClimbingAbility:
    """Predict drawbar pull and slope against slip, with their uncertainty.

    The samples vary the soil, the measured stress and the load of the front wheels. All wheels have
    the same slip. The curve covers the slips at which the stress of both wheels was measured.

    Parameters
    ----------
    ground
        Result of `identify_ground`.
    front, rear
        Stress on a front and on a rear wheel against slip.
    seed
        Seed of the samples.

    Raises
    ------
    FitError
        If the slips measured on front and rear wheel do not overlap.

    References
    ----------
    Nagatani et al., section 7.
    """
    ends = [(wheel.slip.min(), wheel.slip.max()) for wheel in (front, rear)]
    lowest, highest = max(low for low, _ in ends), min(high for _, high in ends)
    if not lowest < highest:
        (a, b), (c, d) = ends
        raise FitError(
            f"stress was measured on the front wheel at slips {a:.3g} to {b:.3g} and on the rear "
            f"at {c:.3g} to {d:.3g}; the two ranges must overlap"
        )
    rng = np.random.default_rng(seed)
    slip = np.linspace(lowest, highest, CURVE_SLIPS)
    pull, slope = [], []
    for _ in range(STRESS_RESAMPLES):
        chosen = rng.integers(len(ground.samples_as_measured), size=SOILS_PER_RESAMPLE)
        soils = ground.samples_as_measured[chosen]
        load_factor = 1.0 + ground.noise.front_load * rng.normal(size=SOILS_PER_RESAMPLE)
        front_share = np.clip(ground.rover.front_share * load_factor, 0.05, 0.95)
        profiles = [wheel.resampled(rng).profiles(slip) for wheel in (front, rear)]
        pull_and_slope: Floats = np.asarray(  # (n, 2, SOILS_PER_RESAMPLE)
            [
                pull_and_slope_at(float(s), both, ground.rover, soils.T, front_share)
                for s, *both in zip(slip, *profiles, strict=True)
            ]
        )
        pull.append(pull_and_slope[:, 0].T)
        slope.append(pull_and_slope[:, 1].T)
    return ClimbingAbility(slip=slip, pull=np.concatenate(pull), slope=np.concatenate(slope))


def pull_and_slope_at(
    slip: float,
    profiles: Sequence[StressProfile],
    rover: Rover,
    shear: Sequence[Real] | Floats,
    front_share: Real,
) -> tuple[Real, Real]:
    """Pull on level ground (N) and slope climbed (rad) of a rover whose wheels have one slip.

    profiles: Of front and rear. shear: Cohesion (Pa), friction angle (rad) and k_x (m), (n,) each.
    """
    cohesion, friction, modulus = shear
    parts = rover.parts([WheelRun(slip, profile) for profile in profiles], modulus)
    pull = rover.pull(parts, cohesion, np.tan(friction), front_share)
    return pull.pull(0.0), pull.equilibrium_slope()
