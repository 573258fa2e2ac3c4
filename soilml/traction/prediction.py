"""What a vehicle does by the posterior and by the prior, and what limits that."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.wheeled_rover import GRAVITY
from soilml.fitting.mixtures import EXCLUDED_KINDS
from soilml.numerics.quantiles import quantile_band
from soilml.physics.soils.gravity_law import GravityChange
from soilml.quantities import NOT_IDENTIFIED_ABOVE, WEAKLY_IDENTIFIED_ABOVE
from soilml.remarks import Remark
from soilml.traction.draws import SoilDraws
from soilml.traction.measured_range import MeasuredRange, extrapolations
from soilml.traction.vehicle import DrivenVehicle, Performance, performance

FEWEST = 0.5  # Share of draws that move below which a vehicle does not
OVERTURNING = float(np.deg2rad(45.0))  # Slope, rad, beyond which vehicles overturn
#: Gravity, m/s^2, and relative difference from it, from which on it is not the Earth's.
EARTH, OTHER_GRAVITY = GRAVITY["earth"], 0.02


@dataclass(frozen=True)
class TractionPrediction:
    """What a vehicle does by the posterior, and on level ground by the prior, with warnings."""

    vehicle: DrivenVehicle
    posterior: Performance
    prior: Performance
    warnings: tuple[Remark, ...] = ()

    @property
    def remaining_fraction(self) -> tuple[float, float]:
        """Widths of the bands of largest pull and steepest slope over those of the prior."""
        after, before = self.posterior, self.prior
        return (
            _width_ratio(after.largest_pull, before.largest_pull),
            _width_ratio(after.steepest_slope, before.steepest_slope),
        )


def _width_ratio(posterior: Floats, prior: Floats) -> float:
    """Width of the band of draws over that of the prior's; NaN where that has none."""
    width, prior_width = quantile_band(posterior).width, quantile_band(prior).width
    return float(width / prior_width) if prior_width > 0.0 else np.nan


def predicted(
    vehicle: DrivenVehicle,
    draws: SoilDraws,
    prior: SoilDraws,
    slopes: Floats,
    slip: Floats,
    measured: MeasuredRange,
) -> TractionPrediction:
    """The prediction of a vehicle by draws of the posterior and of the prior.

    slopes, slip: Slopes (q,), rad, and increasing slips (m,).

    Raises `InputError` as `performance` does.
    """
    after = performance(vehicle, draws, slopes, slip)
    before = performance(vehicle, prior, np.zeros(0), slip, needed=False)
    found = TractionPrediction(vehicle, after, before)
    warnings = prediction_warnings(found, measured, error_included=draws.errors is not None)
    return replace(found, warnings=tuple(warnings))


def prediction_warnings(
    found: TractionPrediction, measured: MeasuredRange, *, error_included: bool
) -> Iterator[Remark]:
    """Warnings about a prediction.

    `error_included` is whether the draws include errors of the model.
    """
    own, vehicle = found.posterior, found.vehicle
    for name, fraction in zip(
        ("largest pull", "steepest slope"), found.remaining_fraction, strict=True
    ):
        width = f"its band is {min(fraction, 1.0):.0%} as wide as the prior's"
        if fraction > NOT_IDENTIFIED_ABOVE:
            text = f"the {name} is not identified by these rows: {width}; do not use it"
            yield Remark("not-identified", text, (name,))
        elif fraction > WEAKLY_IDENTIFIED_ABOVE:
            yield Remark("weakly-identified", f"the {name} is weakly identified: {width}", (name,))
    level = np.ravel(vehicle.loads(np.zeros(1)))
    loads = level
    if len(vehicle.wheels) > 1:  # which share the weight by the slope
        loads = np.concatenate([level, *own.loads.values()])
    yield from extrapolations(own.curve_slip, loads, measured, error_included)
    if own.failed_fraction > 0.0:
        text = (
            f"{own.failed_fraction:.0%} of the soils and slips do not carry {level.max():.4g} N "
            "and are excluded"
        )
        yield Remark("not-carried", text)
    if 0.0 < own.still_fraction <= FEWEST:
        yield Remark(
            "does-not-move",
            f"{own.still_fraction:.0%} of the soils do not let it move: the bands of its steepest "
            "slope are those of the others",
        )
    at_end = np.nan_to_num(own.steepest_slope) > vehicle.steepest - 1e-3
    if len(vehicle.wheels) > 1 and at_end.mean() > 0.05:
        text = f"a wheel leaves the ground at {np.rad2deg(vehicle.steepest):.1f} deg"
        yield Remark("tipping", text)
    if own.still_fraction < FEWEST and np.nanmedian(own.steepest_slope) > OVERTURNING:
        yield Remark(
            "overturning",
            "slopes beyond 45 degrees are due to cohesion under a light load: vehicles overturn "
            "earlier",
        )
    if own.rising_fraction > 0.5:
        yield Remark(
            "still-rising",
            f"the pull still increases at slip {own.slip_limit:g}, the highest evaluated: it may "
            "be larger beyond",
        )


def excluded_effects(case: Case) -> list[Remark]:
    """A remark on the effects that `without_faults` leaves out, if there are any."""
    names = [e.name for e in case.model.effects if e.about.kind in EXCLUDED_KINDS]
    text = f"effects of rig and sensors are excluded: {', '.join(names)}"
    return [Remark("effects-excluded", text, tuple(names), "note")] if names else []


def gravity_remarks(case: Case, gravity: GravityChange | None, of_rover: bool) -> Iterator[Remark]:
    """What is assumed of the soil under another gravity than the Earth's."""
    if gravity is not None and gravity.ratio != 1.0:
        text = {
            "open": "is drawn between one whose moduli stay and one whose kphi is in proportion to "
            "gravity: rows under one gravity do not tell which",
            "constant": "is taken to keep its moduli",
            "proportional": "is taken to have its kphi in proportion to gravity",
        }[gravity.law]
        if gravity.ratio < 1.0:
            text += "; in flights a wheel sank deeper and pulled less than under its load on Earth"
        yield Remark(
            "gravity-law",
            f"gravity is {gravity.target:.3g} m/s^2, rows are from {gravity.tested:.3g} m/s^2: the "
            f"soil {text}",
            severity="warning" if gravity.law == "constant" else "note",
        )
        return
    own = case.rover.gravity if of_rover and case.rover is not None else EARTH
    if abs(own / EARTH - 1.0) > OTHER_GRAVITY:
        yield Remark(
            "other-gravity",
            f"gravity is {own:.3g} m/s^2, of the rows too: if these are from elsewhere, the soil "
            "may have other parameters (--gravity, --tested-at)",
        )
