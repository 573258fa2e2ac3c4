"""Drawbar pull against slip, and the steepest slope, predicted before the climb."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats, Real
from soilml.errors import FitError, InputError
from soilml.systems.rim_stress.climb import Rover, WheelRun
from soilml.systems.rim_stress.climb_balances import wheel_components
from soilml.systems.rim_stress.force_balance import SlopePull
from soilml.systems.rim_stress.ground import GroundEstimate
from soilml.systems.rim_stress.stress_by_slip import StressBySlip

#: Points of the curve over slip; resamples of the measured stress; soil samples taken with each
#: resample. Forces are computed for all soils of a resample at once: 24 x 16 samples determine the
#: ends of a 90 % interval to about 1.5 % of probability.
CURVE_SLIPS, STRESS_RESAMPLES, SOILS_PER_RESAMPLE = 25, 24, 16


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

    def steepest_within(self, slip_limit: float) -> Floats:
        """The steepest slope (rad) of each sample at slips up to a limit, (samples,).

        Raises `InputError` for a limit outside the slips at which stress was measured.
        """
        check_slip(slip_limit, (float(self.slip[0]), float(self.slip[-1])))
        at_limit = np.asarray([np.interp(slip_limit, self.slip, slope) for slope in self.slope])
        below = np.where(self.slip <= slip_limit, self.slope, -np.inf).max(axis=1)
        return np.asarray(np.maximum(at_limit, below))


def shared_slips(front: StressBySlip, rear: StressBySlip) -> tuple[float, float]:
    """Range of slips at which the stress of both wheels is known; raises `FitError` if empty."""
    lowest, highest = max(front.lowest, rear.lowest), min(front.highest, rear.highest)
    if not lowest < highest:
        raise FitError(
            f"stress was measured on the front wheel at slips {front.lowest:.3g} to "
            f"{front.highest:.3g} and on the rear at {rear.lowest:.3g} to {rear.highest:.3g}; "
            "the two ranges must overlap"
        )
    return lowest, highest


def check_slip(limit: float, measured: tuple[float, float]) -> None:
    """Raise `InputError` for a slip limit outside the slips at which stress was measured."""
    if not measured[0] <= limit <= measured[1]:
        raise InputError(
            f"slip limit {limit:g}: stress was measured at slips from {measured[0]:.3g} to "
            f"{measured[1]:.3g} only; there is no prediction outside"
        )


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

    Examples
    --------
    >>> from soilml.numerics.quantiles import quantile_band
    >>> from soilml.systems.rim_stress import SimulatedRover, identify_ground
    >>> true, rng = SimulatedRover(), np.random.default_rng(0)
    >>> climbs = true.simulate_climbs(rng, np.deg2rad([0.0, 4.0]).tolist(), repeats=2)
    >>> sand = {"cohesion": 0.0, "friction_angle": 0.6632}
    >>> ground = identify_ground(true.rover, climbs, fixed=sand)
    >>> front, rear = true.simulate_artificial_slip(rng)
    >>> ability = climbing_ability(ground, StressBySlip.fit(front), StressBySlip.fit(rear))
    >>> round(float(np.rad2deg(quantile_band(ability.steepest).middle)))  # true: 13.2
    13
    """
    lowest, highest = shared_slips(front, rear)
    rng = np.random.default_rng(seed)
    slip = np.linspace(lowest, highest, CURVE_SLIPS)
    pull, slope = [], []
    for _ in range(STRESS_RESAMPLES):
        chosen = rng.integers(len(ground.samples_as_measured), size=SOILS_PER_RESAMPLE)
        soils = ground.samples_as_measured[chosen]
        load_factor = 1.0 + ground.noise.front_load * rng.normal(size=SOILS_PER_RESAMPLE)
        # without a known centre of mass the weight is shared equally; at least 5 % on each axle
        front_share = np.clip((ground.rover.front_share or 0.5) * load_factor, 0.05, 0.95)
        profiles = [wheel.resampled(rng).profiles(slip) for wheel in (front, rear)]
        by_slip = []
        for s, *both in zip(slip, *profiles, strict=True):
            wheels = [
                wheel_components(WheelRun(float(s), profile), ground.rover, soils[:, 2])
                for profile in both
            ]
            forces = slope_pull(ground.rover, wheels, soils[:, 0], np.tan(soils[:, 1]), front_share)
            by_slip.append((forces.pull(0.0), forces.equilibrium_slope()))
        pull_and_slope: Floats = np.asarray(by_slip)  # (n, 2, SOILS_PER_RESAMPLE)
        pull.append(pull_and_slope[:, 0].T)
        slope.append(pull_and_slope[:, 1].T)
    return ClimbingAbility(slip=slip, pull=np.concatenate(pull), slope=np.concatenate(slope))


def slope_pull(
    rover: Rover,
    wheels: Sequence[Floats],
    cohesion: Real,
    tangent: Real,
    front_share: Real,
) -> SlopePull:
    r"""Drawbar pull of a rover whose wheels have one slip, as a function of the slope.

    Each wheel's ratio of pull to load on soil without cohesion is :math:`\rho`, the loads are
    :math:`a \cos\alpha - h \sin\alpha` and :math:`(1 - a) \cos\alpha + h \sin\alpha` times the
    weight, and M of each wheel follows from its load:

    .. math::
        F_x = m g [(a \rho_f + (1 - a) \rho_r) \cos\alpha + h (\rho_r - \rho_f) \sin\alpha]
              + 2 c \sum (C_x - \rho C_z)
    """
    each = [SlopePull.of_wheel(parts, rover.weight, cohesion, tangent) for parts in wheels]
    shares, height = (front_share, 1.0 - front_share), rover.height_ratio or 0.0
    return SlopePull(
        weight=rover.weight,
        cos_term=sum(share * one.cos_term for share, one in zip(shares, each, strict=True)),
        sin_term=height * (each[1].cos_term - each[0].cos_term),
        constant=2.0 * sum(one.constant for one in each),
    )
