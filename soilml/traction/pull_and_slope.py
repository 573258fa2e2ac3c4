"""Drawbar pull and climbable slope against slip, for draws of the soil and of the model's error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.mixtures import EXCLUDED_KINDS, without_faults
from soilml.fitting.predictions import forces_of_one_gear
from soilml.numerics.quantiles import quantile_band
from soilml.numerics.root_finding import rising_root
from soilml.physics.contact import Force
from soilml.physics.operating_point import Operating
from soilml.physics.pull_efficiency import has_thrust, pull_efficiency, tractive_efficiency
from soilml.physics.soils.gravity_law import GravityChange
from soilml.quantities import NOT_IDENTIFIED_ABOVE, WEAKLY_IDENTIFIED_ABOVE
from soilml.remarks import Remark
from soilml.row_status import Status
from soilml.traction.draws import SoilDraws
from soilml.traction.gravity import draws_at_gravity
from soilml.traction.measured_range import MeasuredRange, extrapolations

#: Upper end of the slopes searched, rad (86 degrees); steeper ones are clipped to it.
LARGEST_SLOPE = 1.5


@dataclass(frozen=True)
class Traction:
    """Pull and slope of a running gear under one load, for n draws of the soil and m slips.

    load: Vertical load, N.
    slip: Slips (m,).
    pull: Drawbar pull on level ground, N (n, m); NaN where the soil does not carry the load.
    slope: Slope that a vehicle climbs steadily, rad (n, m); negative where it only descends.
    sinkage: Sinkage on level ground, m (n, m).
    tractive_efficiency: Power at the drawbar over that of the drive on level ground, (n, m); NaN
        for a leg.
    pull_efficiency: Share of the thrust that is left as pull, (n, m); NaN for a leg and for an
        emulator.
    """

    load: float
    slip: Floats
    pull: Floats
    slope: Floats
    sinkage: Floats
    tractive_efficiency: Floats
    pull_efficiency: Floats

    @property
    def largest_pull(self) -> Floats:
        """The largest drawbar pull of each draw, N (n,)."""
        return _largest(self.pull)

    @property
    def best_slip(self) -> Floats:
        """The slip at the largest drawbar pull, (n,)."""
        return self._slip_of(self.pull)

    @property
    def steepest_slope(self) -> Floats:
        """The steepest slope of each draw, rad (n,)."""
        return _largest(self.slope)

    @property
    def steepest_slip(self) -> Floats:
        """The slip at the steepest slope, (n,)."""
        return self._slip_of(self.slope)

    @property
    def most_efficient(self) -> int | None:
        """Index of the slip of the largest median tractive efficiency; None without one."""
        usual = quantile_band(self.tractive_efficiency).middle
        return int(np.nanargmax(usual)) if np.isfinite(usual).any() else None

    @property
    def failed_fraction(self) -> float:
        """Fraction of draws and slips without equilibrium."""
        return float(np.mean(~np.isfinite(self.pull)))

    @property
    def rising_fraction(self) -> float:
        """Fraction of draws whose pull still increases at the highest slip."""
        return float(np.mean(self.best_slip == self.slip[-1]))

    def _slip_of(self, values: Floats) -> Floats:
        slip = self.slip[np.argmax(np.nan_to_num(values, nan=-np.inf), axis=1)]
        return np.where(np.isfinite(values).any(axis=1), slip, np.nan)


def excluded_effects(case: Case) -> list[Remark]:
    """A remark on the effects that `without_faults` leaves out, if there are any."""
    names = [e.name for e in case.model.effects if e.about.kind in EXCLUDED_KINDS]
    text = f"effects of rig and sensors are excluded: {', '.join(names)}"
    return [Remark("effects-excluded", text, tuple(names), "note")] if names else []


def predict_traction(
    case: Case,
    draws: SoilDraws,
    load: float,
    slip: Floats,
    covariates: Mapping[str, float] | None = None,
) -> Traction:
    r"""Pull and slope for n draws of the soil at m slips under a load.

    The slope :math:`\alpha` is the one on which the drawbar pull under the normal component of the
    load equals the component along the slope,

    .. math:: W \sin\alpha = DP(s, W \cos\alpha)

    with all wheels equal. Effects of the rig and the sensors are removed from the model. Does not
    hold with load transfer between axles, across the slope, in turns, nor where the slope itself is
    close to sliding.

    Parameters
    ----------
    case
        Model and soil.
    draws
        Draws (n, p) of soil parameters, with errors of the model where it has some.
    load
        Vertical load on level ground, N.
    slip
        Slips (m,).
    covariates
        Speed, pass number and slip angle, where an effect needs them.

    References
    ----------
    Wong, Theory of Ground Vehicles, chapter 3; the efficiencies as in
    `soilml.physics.pull_efficiency`, without the error of the model's torque.
    """
    case = without_faults(case)
    count = len(draws.values)
    rows, columns = (grid.ravel() for grid in np.indices((count, len(slip))))

    def forces(index: NDArray[np.int64], normal_load: Floats) -> tuple[Operating, Force]:
        at = Operating(slip=slip[columns[index]], load=normal_load, **dict(covariates or {}))
        return at, draws.forces(case, rows[index], at)

    at, force = forces(np.arange(rows.size), np.full(rows.size, load))
    level = np.asarray(force.drawbar_pull)
    tractive, efficiency = np.full((2, rows.size), np.nan)
    if has_thrust(case.model):
        soils = draws.of(case, rows)
        radius = np.asarray(soils.model.gear.radius)
        tractive = np.asarray(tractive_efficiency(radius, at.slip, force.torque, level))
        efficiency = np.asarray(pull_efficiency(soils.model, soils.soil, at))
    carried = np.flatnonzero(np.isfinite(level))

    def excess_angle(angle: Floats) -> Floats:
        """Slope less the one that the pull on it balances."""
        normal_load = load * np.cos(angle)
        pull = forces(carried, normal_load)[1].drawbar_pull
        return np.asarray(angle - np.arctan(pull / normal_load))

    bound = np.full(carried.size, LARGEST_SLOPE)
    guess = np.arctan(level[carried] / load)
    root = rising_root(excess_angle, -bound, bound, guess, np.ones(carried.size))
    slope = np.full(rows.size, np.nan)
    slope[carried] = np.where(root.converged | (root.x >= LARGEST_SLOPE), root.x, np.nan)
    shape = (count, len(slip))
    found = (
        np.reshape(values, shape) for values in (level, slope, force.sinkage, tractive, efficiency)
    )
    return Traction(float(load), slip, *found)


def _largest(values: Floats) -> Floats:
    largest = np.nan_to_num(values, nan=-np.inf).max(axis=1)
    return np.where(np.isfinite(largest), largest, np.nan)


OVERTURNING_SLOPE = 0.7854  # Slope, rad (45 degrees), beyond which vehicles overturn


def prediction_warnings(
    prediction: Traction,
    remaining_fraction: tuple[float, float],
    measured: MeasuredRange,
    *,
    error_included: bool = False,
) -> Iterator[Remark]:
    """Warnings about a prediction; `remaining_fraction` as in `LoadPrediction`.

    `error_included` is whether the draws include a declared error of the pull.
    """
    yield from _identifiability(remaining_fraction)
    failed, load = prediction.failed_fraction, prediction.load
    yield from extrapolations(prediction.slip, np.asarray(load), measured, error_included)
    if failed > 0.0:
        text = f"{failed:.0%} of the soils and slips do not carry {load:.4g} N and are excluded"
        yield Remark("not-carried", text)
    if np.nanmedian(prediction.steepest_slope) > OVERTURNING_SLOPE:
        yield Remark(
            "overturning",
            "slopes beyond 45 degrees are due to cohesion under a light load: vehicles overturn "
            "earlier",
        )
    if prediction.rising_fraction > 0.5:
        yield Remark(
            "still-rising",
            f"the pull still increases at slip {prediction.slip[-1]:g}, the highest evaluated: it "
            "may be larger beyond",
        )


def _identifiability(remaining_fraction: tuple[float, float]) -> Iterator[Remark]:
    for name, fraction in zip(("largest pull", "steepest slope"), remaining_fraction, strict=True):
        width = f"its band is {min(fraction, 1.0):.0%} as wide as the prior's"
        if fraction > NOT_IDENTIFIED_ABOVE:
            text = f"the {name} is not identified by these rows: {width}; do not use it"
            yield Remark("not-identified", text, (name,))
        elif fraction > WEAKLY_IDENTIFIED_ABOVE:
            yield Remark("weakly-identified", f"the {name} is weakly identified: {width}", (name,))


@dataclass(frozen=True)
class LoadPrediction:
    """Pull and slope under one load, from the posterior and from the prior, with warnings."""

    posterior: Traction
    prior: Traction
    warnings: tuple[Remark, ...]

    @property
    def remaining_fraction(self) -> tuple[float, float]:
        """Widths of the bands of largest pull and steepest slope over those of the prior."""
        posterior, prior = self.posterior, self.prior
        return (
            _width_ratio(posterior.largest_pull, prior.largest_pull),
            _width_ratio(posterior.steepest_slope, prior.steepest_slope),
        )


def predictions_by_load(
    case: Case,
    draws: SoilDraws,
    prior: SoilDraws,
    loads: Sequence[float],
    slip: Floats,
    measured: MeasuredRange,
    covariates: Mapping[str, float] | None = None,
    gravity: GravityChange | None = None,
) -> list[LoadPrediction]:
    """Pull and slope under each load (N) at the slips (m,), by draws and by draws of the prior.

    With `gravity`, the draws are those under the gravity of the tests, the answers under the other.

    Raises `InputError` for a load that more than half of the draws do not carry at any sinkage.
    """
    if gravity is not None:
        draws, prior = (draws_at_gravity(case, d, gravity) for d in (draws, prior))
    predictions = []
    for load in loads:
        _check_carried(case, draws, load, slip, covariates)
        after, before = (predict_traction(case, d, load, slip, covariates) for d in (draws, prior))
        bare = LoadPrediction(after, before, ())
        warnings = prediction_warnings(
            after, bare.remaining_fraction, measured, error_included=draws.errors is not None
        )
        predictions.append(replace(bare, warnings=tuple(warnings)))
    return predictions


def _width_ratio(posterior: Floats, prior: Floats) -> float:
    """Width of the band of draws over that of the prior's; NaN where that has none."""
    width, prior_width = quantile_band(posterior).width, quantile_band(prior).width
    return float(width / prior_width) if prior_width > 0.0 else np.nan


def _check_carried(
    case: Case, draws: SoilDraws, load: float, slip: Floats, covariates: Mapping[str, float] | None
) -> None:
    if not (np.isfinite(load) and load > 0.0):
        raise InputError(f"load {load:g} N; needed is a load above zero")
    soils = draws.of(case, np.arange(len(draws.values)))
    at = Operating(slip=float(slip[0]), load=load, **dict(covariates or {}))
    force = forces_of_one_gear(soils, at)
    failed = np.asarray(force.status)[np.asarray(force.status) != 0]
    if failed.size > 0.5 * len(draws.values):
        worst = Status(int(np.bincount(failed).argmax()))
        heaviest = float(np.median(np.asarray(force.load)[np.asarray(force.status) == worst]))
        limit = f" (at most about {heaviest:.3g} N)" if worst is Status.TOO_HEAVY else ""
        raise InputError(f"load {load:g} N: {worst.reason}{limit}; give another, or check kphi")
