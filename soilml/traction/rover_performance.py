"""What a rover does on slopes of a soil that is known by draws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.wheeled_rover import WheeledRover
from soilml.errors import InputError
from soilml.fitting.mixtures import without_faults
from soilml.fitting.operating_points import wheel_gears, wheel_passes
from soilml.numerics.root_finding import rising_root
from soilml.traction.draws import SoilDraws

SAME_LOAD = 1e-9  # Loads (N) that agree to this share are those of one wheel, solved once
LARGEST_SLOPE = np.deg2rad(60.0)  # Steepest slope that is looked at, rad (60 degrees)
#: Slips below the first of a grid, as shares of it: pull rises steeply there.
FIRST_SHARES = (0.05, 0.1, 0.2, 0.4, 0.7)


@dataclass(frozen=True)
class WheelCurves:
    """Of k wheels, for n draws of the soil and m slips, (k, n, m); NaN where not carried."""

    pull: Floats  # N
    torque: Floats  # N m
    sinkage: Floats  # m
    radius: Floats  # (k,), m

    @property
    def total_pull(self) -> Floats:
        """Pull of all wheels, N (n, m)."""
        return np.asarray(self.pull.sum(axis=0))

    def energy(self, slip: Floats) -> Floats:
        r"""Mechanical work of all wheels for each metre of travel, J/m (n, m).

        .. math:: E = \sum_i \frac{T_i}{r_i (1 - s)}
        """
        work = (self.torque / self.radius[:, None, None]).sum(axis=0)
        return np.asarray(work / (1.0 - slip))


def wheel_curves(
    case: Case, draws: SoilDraws, slope: Floats, slip: Floats, speed: float | None = None
) -> WheelCurves:
    """Curves of a case's rover straight up a slope.

    case: With a rover. Effects of rig and sensors are left out.
    draws: Draws (n, p) of the soil.
    slope: In rad, a number or one for each draw (n,).
    slip: Slips (m,).
    speed: Travel speed, m/s, where an effect needs it.

    Raises `InputError` where a wheel leaves the ground, or an effect needs what a rover does not
    tell.
    """
    rover = case.rover
    assert rover is not None
    count = len(draws.values)
    loads = rover.loads(np.broadcast_to(slope, count))
    gears, passes = wheel_gears(case), wheel_passes(case)
    solved: list[tuple[str, int, Floats, tuple[Floats, ...]]] = []
    curves, radius = [], []
    for name, load in zip(rover.wheels, loads, strict=True):
        own_case = case.of_gear(gears[name]) if gears[name] else case
        radius.append(float(own_case.model.gear.radius))
        same = [
            found
            for gear, number, other, found in solved
            if gear == gears[name]
            and number == passes[name]
            and np.allclose(load, other, rtol=SAME_LOAD, atol=0.0)
        ]
        if not same:
            force = draws.on_grid(
                without_faults(own_case), load, slip, gears[name],
                pass_number=float(passes[name]), speed=speed, slip_angle=0.0,
            )  # fmt: skip
            found = force.drawbar_pull, force.torque, force.sinkage
            solved.append((gears[name], passes[name], load, found))
            same = [found]
        curves.append(same[0])
    pull, torque, sinkage = (np.stack(each) for each in zip(*curves, strict=True))
    return WheelCurves(pull, torque, sinkage, np.asarray(radius))


@dataclass(frozen=True)
class RoverPerformance:
    """A rover straight up m slopes at constant speed, for n draws of the soil.

    slope: Slopes (m,), rad.
    slip: Slip that the slope needs, (n, m); NaN where no slip up to the limit suffices.
    margin: Largest pull up to the slip limit less the weight along the slope, N (n, m).
    energy: Mechanical work of the wheels for each metre of travel, J/m (n, m).
    loads: Of each wheel, N (m,).
    torque, sinkage: Of each wheel at the needed slip, N m and m (n, m).
    passes: Pass of each wheel.
    steepest_slope: Of each draw, rad (n,); NaN where the rover does not move on level ground.
    best_slip: Slip of the best ratio of pulling power to wheel power on level ground, (n,).
    slip_limit: Highest slip considered.
    """

    slope: Floats
    slip: Floats
    margin: Floats
    energy: Floats
    loads: Mapping[str, Floats]
    torque: Mapping[str, Floats]
    sinkage: Mapping[str, Floats]
    passes: Mapping[str, int]
    steepest_slope: Floats
    best_slip: Floats
    slip_limit: float

    @property
    def climbed(self) -> Floats:
        """Probability that each slope is climbed, (m,)."""
        return np.asarray(np.mean(self.margin >= 0.0, axis=0))


def rover_for(case: Case, slopes: Floats) -> WheeledRover:
    """The rover of a case; `InputError` without one, or for slopes (rad) out of its bounds."""
    if case.rover is None:
        raise InputError("the model file has no [rover]")
    if not np.all((slopes >= 0.0) & (slopes <= LARGEST_SLOPE)):
        raise InputError("slopes of a rover must lie between 0 and 60 degrees")
    case.rover.loads(slopes)  # which no wheel may leave the ground under
    return case.rover


def on_slopes(
    case: Case, draws: SoilDraws, slopes: Floats, slip: Floats, speed: float | None = None
) -> tuple[Floats, dict[str, Floats]]:
    """Needed slip, margin, energy, torque and sinkage on slopes (m,), by name, (..., n, m).

    With the slips between which is interpolated: those given, and some below the first. Takes what
    `rover_performance` takes, and raises as it does.
    """
    rover = rover_for(case, slopes)
    slip = np.concatenate([np.asarray(FIRST_SHARES) * slip[0], slip])
    on_slope = []
    for slope in slopes:
        curves = wheel_curves(case, draws, np.asarray(slope), slip, speed)
        if np.mean(~np.isfinite(curves.total_pull[:, 0])) > 0.5:
            heaviest = float(rover.loads(float(slope)).max())
            raise InputError(
                f"the soil does not carry a wheel of {heaviest:.4g} N; check [rover], kphi and n"
            )
        on_slope.append(_at_needed_slip(curves, slip, rover.weight * np.sin(slope)))
    return slip, {key: np.stack([one[key] for one in on_slope], axis=-1) for key in on_slope[0]}


def rover_performance(
    case: Case, draws: SoilDraws, slopes: Floats, slip: Floats, speed: float | None = None
) -> RoverPerformance:
    r"""Slip, margin, energy, torque and sinkage on slopes, and the steepest slope.

    .. math:: \sum_i DP_i(s, W_i(\alpha)) = m g \sin\alpha

    at the least slip s that all wheels share, since their rims have one speed.

    case: With a rover, see `WheeledRover`.
    draws: Draws (n, p) of the soil.
    slopes: Slopes (m,) from 0 to 60 degrees, rad.
    slip: Increasing slips up to the limit.
    speed: Travel speed, m/s, where an effect needs it.

    Raises `InputError` for a slope outside these bounds, on which a wheel leaves the ground, or
    under which more than half of the draws do not carry a wheel.

    Notes
    -----
    Does not hold across a slope, in turns, for a suspension that shares the load otherwise than
    equal springs, nor where the slope itself is close to sliding. Soil parameters are taken as
    they are: whether those measured under one gravity hold under another is not known.

    References
    ----------
    Wong, Theory of Ground Vehicles, chapters 2 and 3.
    """
    slip, joined = on_slopes(case, draws, slopes, slip, speed)
    rover = case.rover
    assert rover is not None
    names = list(rover.wheels)
    loads = rover.loads(slopes)
    level = wheel_curves(case, draws, np.zeros(1), slip, speed)
    ratio = np.nan_to_num(level.total_pull / level.energy(slip), nan=-np.inf)
    return RoverPerformance(
        slope=slopes,
        slip=joined["slip"],
        margin=joined["margin"],
        energy=joined["energy"],
        loads=dict(zip(names, loads, strict=True)),
        torque=dict(zip(names, joined["torque"], strict=True)),
        sinkage=dict(zip(names, joined["sinkage"], strict=True)),
        passes=wheel_passes(case),
        steepest_slope=_steepest(case, draws, slip, speed, level),
        best_slip=np.where(ratio.max(axis=1) > 0.0, slip[np.argmax(ratio, axis=1)], np.nan),
        slip_limit=float(slip[-1]),
    )


@dataclass(frozen=True)
class NeededSlip:
    """The least of m slips at which curves reach what is needed, (...), and what holds there."""

    before: NDArray[np.int64]  # index of the slip before, (..., 1)
    index: NDArray[np.int64]
    share: Floats  # of the way between both
    reached: NDArray[np.bool_]

    @staticmethod
    def of(total: Floats, needed: Floats) -> NeededSlip:
        """For totals (..., m) of one unit with what is needed, which broadcasts to (...)."""
        enough = np.nan_to_num(total, nan=-np.inf) >= needed[..., None]
        index = np.argmax(enough, axis=-1)[..., None]
        before = np.maximum(index - 1, 0)
        low, high = (np.take_along_axis(total, i, axis=-1) for i in (before, index))
        rise = np.where(high > low, high - low, 1.0)
        share = np.where(index > 0, (needed[..., None] - low) / rise, 1.0)[..., 0]
        return NeededSlip(before, index, share, np.asarray(enough.any(axis=-1)))

    def of_curve(self, values: Floats) -> Floats:
        """Values (..., m), or more of such, interpolated there; NaN where it is not reached."""
        low, high = (
            np.take_along_axis(values, np.broadcast_to(i, (*values.shape[:-1], 1)), axis=-1)[..., 0]
            for i in (self.before, self.index)
        )
        return np.asarray(np.where(self.reached, low + self.share * (high - low), np.nan))


def _at_needed_slip(curves: WheelCurves, slip: Floats, needed: float) -> dict[str, Floats]:
    """What holds at the least slip whose pull is the needed one (N), each with n draws."""
    pull = curves.total_pull
    at = NeededSlip.of(pull, np.asarray(needed))
    return {
        "slip": at.of_curve(np.broadcast_to(slip, pull.shape)),
        "margin": np.where(np.isfinite(pull).any(axis=1), _largest(pull) - needed, np.nan),
        "energy": at.of_curve(curves.energy(slip)),
        "torque": at.of_curve(curves.torque),
        "sinkage": at.of_curve(curves.sinkage),
    }


def _steepest(
    case: Case, draws: SoilDraws, slip: Floats, speed: float | None, level: WheelCurves
) -> Floats:
    """Steepest slope of each draw, rad (n,); at most the slope where a wheel leaves the ground."""
    rover = case.rover
    assert rover is not None
    share = _largest(level.total_pull) / rover.weight
    moving = np.flatnonzero(share > 0.0)
    steepest = np.full(len(share), np.nan)
    if not moving.size:
        return steepest
    own = draws.of_draws(moving)

    def excess(slope: Floats) -> Floats:
        """Weight along the slope less the largest pull there, over the weight."""
        pull = wheel_curves(case, own, slope, slip, speed).total_pull
        return np.asarray(np.sin(slope) - _largest(pull) / rover.weight)

    end = np.full(moving.size, rover.tipping_slope(float(LARGEST_SLOPE)))
    guess = np.arcsin(np.clip(share[moving], 0.0, np.sin(end)))
    root = rising_root(excess, np.zeros(moving.size), end, guess, np.ones(moving.size))
    steepest[moving] = root.x
    return steepest


def _largest(pull: Floats) -> Floats:
    """The largest pull of each draw up to the slip limit, N (n,); below any where none is."""
    return np.asarray(np.nan_to_num(pull, nan=-np.inf).max(axis=1))
