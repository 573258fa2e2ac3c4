"""What wheels that share one slip do on a soil that is known by draws: of a rover, or one wheel."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.mixtures import without_faults
from soilml.fitting.operating_points import wheel_gears, wheel_passes
from soilml.numerics.root_finding import rising_root
from soilml.physics.contact import Force
from soilml.physics.pull_efficiency import has_thrust
from soilml.row_status import Status
from soilml.traction.draws import SoilDraws

SAME_LOAD = 1e-9  # Shares of the weight that agree to this are loads of one wheel, solved once
LARGEST_SLOPE = float(np.deg2rad(60.0))  # Steepest slope that is looked at, rad
#: Slips below the first of a grid, as shares of it: pull rises steeply there.
FIRST_SHARES = (0.05, 0.1, 0.2, 0.4, 0.7)


@dataclass(frozen=True)
class DrivenVehicle:
    """Driven wheels that share one slip: those of a rover, or one under its share of a vehicle.

    case: Model and soil. Effects of rig and sensors are left out.
    weight: In N.
    wheels: Gear of each wheel, and its further fields of `Operating`; "" is the gear of a case with
        one.
    loads: Load on each wheel, N (k, ...), on slopes (...), rad; it raises `InputError` where a
        wheel leaves the ground.
    steepest: Slope up to which all wheels stay on the ground, rad, at most `LARGEST_SLOPE`.
    """

    case: Case
    weight: float
    wheels: Mapping[str, tuple[str, Mapping[str, float]]]
    loads: Callable[[Floats], Floats]
    steepest: float = LARGEST_SLOPE

    @staticmethod
    def of_rover(case: Case, speed: float | None = None) -> DrivenVehicle:
        """The rover of a case at a travel speed, m/s; `InputError` without a rover."""
        rover = case.rover
        if rover is None:
            raise InputError("the model file has no [rover]; needed are its mass and wheels")
        gears, passes = wheel_gears(case), wheel_passes(case)
        others = {"slip_angle": 0.0} | ({} if speed is None else {"speed": speed})
        wheels = {
            name: (gears[name], {**others, "pass_number": float(passes[name])})
            for name in rover.wheels
        }
        return DrivenVehicle(
            case, rover.weight, wheels, rover.loads, rover.tipping_slope(LARGEST_SLOPE)
        )

    @staticmethod
    def of_wheel(
        case: Case, load: float, covariates: Mapping[str, float] | None = None
    ) -> DrivenVehicle:
        """One wheel under a load on level ground, N, of a vehicle whose wheels are all equal.

        covariates: Speed, pass number and slip angle, where an effect needs them.
        """
        if not (np.isfinite(load) and load > 0.0):
            raise InputError(f"load {load:g} N; needed is a load above zero")

        def loads(slope: Floats) -> Floats:
            return load * np.cos(np.asarray(slope))[None]

        return DrivenVehicle(case, float(load), {"": ("", dict(covariates or {}))}, loads)

    def check_slopes(self, slopes: Floats) -> None:
        """Raise `InputError` for slopes (rad) out of bounds, or where a wheel leaves the ground."""
        if not np.all((slopes >= 0.0) & (slopes <= LARGEST_SLOPE)):
            raise InputError("slopes must lie between 0 and 60 degrees")
        self.loads(slopes)


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
    vehicle: DrivenVehicle,
    draws: SoilDraws,
    slope: Floats | float,
    slip: Floats,
    *,
    needed: bool = False,
) -> WheelCurves:
    """Curves of a vehicle straight up a slope.

    draws: Draws (n, p) of the soil.
    slope: In rad, a number or one for each draw (n,).
    slip: Slips (m,).
    needed: Whether more than half of the draws must carry each wheel.

    Raises `InputError` where a wheel leaves the ground or is not carried though needed, or an
    effect needs what is not known of the vehicle.
    """
    loads = vehicle.loads(np.broadcast_to(slope, len(draws.values)))
    solved: dict[tuple[object, ...], tuple[Floats, ...]] = {}
    curves, radius = [], []
    for (gear, others), load in zip(vehicle.wheels.values(), loads, strict=True):
        own = vehicle.case.of_gear(gear) if gear else vehicle.case
        radius.append(float(own.model.gear.radius))
        place = np.round(load / (SAME_LOAD * vehicle.weight)).tobytes()
        key = gear, tuple(others.items()), place
        if key not in solved:
            force = draws.on_grid(without_faults(own), load, slip, gear, **others)
            if needed:
                _check_carried(force, float(load.max()))
            solved[key] = force.drawbar_pull, force.torque, force.sinkage
        curves.append(solved[key])
    pull, torque, sinkage = (np.stack(each) for each in zip(*curves, strict=True))
    return WheelCurves(pull, torque, sinkage, np.asarray(radius))


def _check_carried(force: Force, load: float) -> None:
    """Raise `InputError` where more than half of the draws (n, m) do not carry a load, N."""
    status = np.asarray(force.status)[:, 0]
    if np.mean(status != Status.OK) <= 0.5:
        return
    worst = Status(int(np.bincount(status[status != Status.OK]).argmax()))
    heaviest = float(np.median(np.asarray(force.load)[:, 0][status == worst]))
    limit = f" (at most about {heaviest:.3g} N)" if worst is Status.TOO_HEAVY else ""
    raise InputError(f"load {load:g} N: {worst.reason}{limit}; give another, or check kphi")


@dataclass(frozen=True)
class Performance:
    """A vehicle on level ground at m slips, and at constant speed straight up q slopes.

    For n draws of the soil:

    weight: In N.
    curve_slip: Slips (m,).
    pull: Drawbar pull on level ground, N (n, m); NaN where a soil does not carry the wheels.
    efficiency: Power at the drawbar over that of the drives there, (n, m); NaN for a leg.
    deepest: Sinkage of the deepest wheel there, m (n, m).
    slope: Slopes (q,), rad.
    slip: Slip that the slope needs, (n, q); NaN where no slip up to the limit suffices.
    margin: Largest pull up to the slip limit less the weight along the slope, N (n, q).
    energy: Mechanical work of the wheels for each metre of travel, J/m (n, q).
    loads: Of each wheel, N (q,).
    torque, sinkage: Of each wheel at the needed slip, N m and m (n, q).
    steepest_slope: Of each draw, rad (n,); NaN where it does not move on level ground.
    """

    weight: float
    curve_slip: Floats
    pull: Floats
    efficiency: Floats
    deepest: Floats
    slope: Floats
    slip: Floats
    margin: Floats
    energy: Floats
    loads: Mapping[str, Floats]
    torque: Mapping[str, Floats]
    sinkage: Mapping[str, Floats]
    steepest_slope: Floats

    @property
    def slip_limit(self) -> float:
        """Highest slip considered."""
        return float(self.curve_slip[-1])

    @property
    def climbed(self) -> Floats:
        """Probability that each slope is climbed, (q,)."""
        return np.asarray(np.mean(self.margin >= 0.0, axis=0))

    @property
    def largest_pull(self) -> Floats:
        """The largest drawbar pull of each draw on level ground, N (n,); NaN without one."""
        return _known(_largest(self.pull))

    @property
    def best_efficiency(self) -> Floats:
        """The best efficiency of each draw on level ground, (n,); NaN without one."""
        return _known(_largest(self.efficiency))

    @property
    def strongest_slip(self) -> Floats:
        """The slip at the largest drawbar pull on level ground, (n,)."""
        return self._slip_at_largest(self.pull)

    @property
    def best_slip(self) -> Floats:
        """The slip of the best efficiency on level ground, (n,); NaN where none is above zero."""
        moves = _largest(self.efficiency) > 0.0
        return np.where(moves, self._slip_at_largest(self.efficiency), np.nan)

    @property
    def failed_fraction(self) -> float:
        """Fraction of draws and slips without equilibrium on level ground."""
        return float(np.mean(~np.isfinite(self.pull)))

    @property
    def still_fraction(self) -> float:
        """Fraction of draws that do not move on level ground."""
        return float(np.mean(~np.isfinite(self.steepest_slope)))

    @property
    def rising_fraction(self) -> float:
        """Fraction of draws whose pull still increases at the highest slip."""
        return float(np.mean(self.strongest_slip == self.slip_limit))

    def _slip_at_largest(self, values: Floats) -> Floats:
        slip = self.curve_slip[np.argmax(np.nan_to_num(values, nan=-np.inf), axis=1)]
        return np.where(np.isfinite(values).any(axis=1), slip, np.nan)


def on_slopes(
    vehicle: DrivenVehicle, draws: SoilDraws, slopes: Floats, slip: Floats
) -> dict[str, Floats]:
    """Needed slip, margin, energy, torque and sinkage on slopes (q,), by name, (..., n, q).

    Slips (m,) are those given, and some below the first, between which is interpolated. Raises as
    `performance` does.
    """
    vehicle.check_slopes(slopes)
    slip = np.concatenate([np.asarray(FIRST_SHARES) * slip[0], slip])
    on_slope = []
    for slope in slopes:
        curves = wheel_curves(vehicle, draws, float(slope), slip, needed=True)
        total, weight = curves.total_pull, np.asarray(vehicle.weight * np.sin(slope))
        at = NeededSlip.of(total, weight)
        on_slope.append(
            {
                "slip": at.of_curve(np.broadcast_to(slip, total.shape)),
                "margin": _known(_largest(total)) - weight,
                "energy": at.of_curve(curves.energy(slip)),
                "torque": at.of_curve(curves.torque),
                "sinkage": at.of_curve(curves.sinkage),
            }
        )
    return {key: np.stack([one[key] for one in on_slope], axis=-1) for key in on_slope[0]}


def performance(
    vehicle: DrivenVehicle, draws: SoilDraws, slopes: Floats, slip: Floats, *, needed: bool = True
) -> Performance:
    r"""Pull, efficiency and sinkage on level ground; slip, margin and work on slopes; the steepest.

    .. math:: \sum_i DP_i(s, W_i(\alpha)) = W \sin\alpha

    at the least slip s that all wheels share, since their rims have one speed.

    draws: Draws (n, p) of the soil.
    slopes: Slopes (q,) from 0 to 60 degrees, rad.
    slip: Increasing slips (m,) up to the limit.
    needed: Whether more than half of the draws must carry the wheels.

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
    level = wheel_curves(vehicle, draws, 0.0, slip, needed=needed)
    names, count = list(vehicle.wheels), len(draws.values)
    found = dict.fromkeys(("slip", "margin", "energy"), np.zeros((count, 0)))
    found |= dict.fromkeys(("torque", "sinkage"), np.zeros((len(names), count, 0)))
    loads = np.zeros((len(names), 0))
    if len(slopes):
        found, loads = on_slopes(vehicle, draws, slopes, slip), vehicle.loads(slopes)
    energy = level.energy(slip)
    driven = (energy > 0.0) & has_thrust(vehicle.case.model)
    efficiency = np.where(driven, level.total_pull / np.where(driven, energy, 1.0), np.nan)
    return Performance(
        weight=vehicle.weight,
        curve_slip=slip,
        pull=level.total_pull,
        efficiency=efficiency,
        deepest=np.asarray(level.sinkage.max(axis=0)),
        slope=slopes,
        slip=found["slip"],
        margin=found["margin"],
        energy=found["energy"],
        loads=dict(zip(names, loads, strict=True)),
        torque=dict(zip(names, found["torque"], strict=True)),
        sinkage=dict(zip(names, found["sinkage"], strict=True)),
        steepest_slope=_steepest(vehicle, draws, slip, level),
    )


def _steepest(vehicle: DrivenVehicle, draws: SoilDraws, slip: Floats, level: WheelCurves) -> Floats:
    """Steepest slope of each draw, rad (n,); at most the slope where a wheel leaves the ground."""
    share = _largest(level.total_pull) / vehicle.weight
    moving = np.flatnonzero(share > 0.0)
    steepest = np.full(len(share), np.nan)
    if not moving.size:
        return steepest
    own = draws.of_draws(moving)

    def excess(slope: Floats) -> Floats:
        """Weight along the slope less the largest pull there, over the weight."""
        pull = wheel_curves(vehicle, own, slope, slip).total_pull
        return np.asarray(np.sin(slope) - _largest(pull) / vehicle.weight)

    end = np.full(moving.size, vehicle.steepest)
    guess = np.arcsin(np.clip(share[moving], 0.0, np.sin(end)))
    steepest[moving] = rising_root(excess, np.zeros(moving.size), end, guess,
                                   np.ones(moving.size)).x  # fmt: skip
    return steepest


def _largest(values: Floats) -> Floats:
    """The largest number of each draw (n,); below any where there is none."""
    return np.asarray(np.nan_to_num(values, nan=-np.inf).max(axis=1))


def _known(values: Floats) -> Floats:
    """The values, with NaN where they are not finite."""
    return np.where(np.isfinite(values), values, np.nan)


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
