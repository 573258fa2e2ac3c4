"""What a vehicle does by the posterior and by the prior, and what limits that."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.wheeled_rover import GRAVITY
from soilml.errors import InputError
from soilml.fitting.mixtures import EXCLUDED_KINDS
from soilml.numerics.quantiles import quantile_band
from soilml.physics.soils.gravity_law import GravityChange
from soilml.quantities import NOT_IDENTIFIED_ABOVE, WEAKLY_IDENTIFIED_ABOVE
from soilml.remarks import Remark
from soilml.traction.draws import DrawnErrors, SoilDraws
from soilml.traction.vehicle import DrivenVehicle, Performance, performance

FEWEST = 0.5  # Share of draws that move below which a vehicle does not
OVERTURNING = float(np.deg2rad(45.0))  # Slope, rad, beyond which vehicles overturn
#: Gravity, m/s^2, and relative difference from it, from which on it is not the Earth's.
EARTH, OTHER_GRAVITY = GRAVITY["earth"], 0.02
#: Extrapolation beyond the measured slips (difference) and loads (factor) that is reported.
SLIP_MARGIN, LOAD_FACTOR = 0.1, 1.25
#: Relative difference up to which loads of rows count as equal: noise of a nominal load.
SAME_LOAD = 0.1
MOST_LOADS = 3  # Number of loads predicted by default: the lightest, one between, the heaviest
#: Default highest slip where no row has a higher one, and number of slips of a curve.
DEFAULT_SLIP_LIMIT, SLIPS = 0.6, 12


@dataclass(frozen=True)
class MeasuredRange:
    """Lowest and highest slip, lightest and heaviest load (N) of the rows."""

    slip: tuple[float, float]
    load: tuple[float, float]

    @staticmethod
    def of(slip: Floats, load: Floats) -> MeasuredRange:
        """Those of rows (m,)."""
        ends = ((float(v.min()), float(v.max())) for v in (slip, load))
        return MeasuredRange(*ends)


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


def band_content(before: DrawnErrors | None, beside: str) -> Remark:
    """What the bands include, with the channels of the errors `before`, and what they do not.

    >>> print(band_content(None, "no side slope"))
    bands include the uncertainty of the soil and the noise, not errors of the model; no side slope
    """
    included = "the uncertainty of the soil and the noise, not errors of the model"
    if before is not None:
        names = dict.fromkeys(name.replace("_", " ") for name, _ in before.functions)
        included = (
            f"the uncertainty of the soil, the noise and errors of the model ({', '.join(names)})"
        )
    return Remark("band-content", f"bands include {included}; {beside}", severity="note")


def extrapolations(
    slip: Floats, load: Floats, measured: MeasuredRange, error_included: bool
) -> Iterator[Remark]:
    """Remarks on slips and loads (N) of a prediction beyond those of the rows."""
    error = "may be larger here than stated" if error_included else "is not in the band"
    (low, high), (light, heavy) = measured.slip, measured.load
    for what, unit, asked, ends, (least, most) in (
        ("slip", "", slip, measured.slip, (low - SLIP_MARGIN, high + SLIP_MARGIN)),
        ("load", " N", load, measured.load, (light / LOAD_FACTOR, heavy * LOAD_FACTOR)),
    ):
        lowest, highest = float(np.min(asked)), float(np.max(asked))
        for outside, word, end, value in (
            (highest > most, "above", ends[1], highest),
            (lowest < least, "below", ends[0], lowest),
        ):
            if outside:
                text = (
                    f"no {what} {word} {end:.3g}{unit} was measured, predicted is "
                    f"{value:.3g}{unit}: extrapolated by the model, whose error {error}"
                )
                yield Remark("extrapolated", text)


def measured_loads(load: Floats) -> list[float]:
    """The loads (N) of rows, groups of equal ones as their mean, at most `MOST_LOADS`."""
    ordered = np.sort(load)
    groups = np.split(ordered, 1 + np.flatnonzero(np.diff(ordered) > SAME_LOAD * ordered[1:]))
    means = [float(group.mean()) for group in groups]
    index = np.linspace(0, len(means) - 1, min(len(means), MOST_LOADS)).round().astype(int)
    return [means[i] for i in index]


def slip_grid(limit: float | None, measured: MeasuredRange) -> Floats:
    """Slips (m,) up to a limit; by default to the highest measured slip, at least to 0.6.

    Raises `InputError` for a limit that is not between 0 and 1.
    """
    if limit is not None and not 0.0 < limit < 1.0:
        raise InputError(f"slip limit {limit:g}; needed is a slip between 0 and 1")
    top = max(DEFAULT_SLIP_LIMIT, measured.slip[1]) if limit is None else limit
    return np.asarray(top * np.arange(1, SLIPS + 1) / SLIPS)
