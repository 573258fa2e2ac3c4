"""Pull and slope under several loads, from the posterior and from the prior, with warnings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.predictions import forces_of_one_gear
from soilml.numerics.quantiles import quantile_band
from soilml.physics.operating_point import Operating
from soilml.physics.soils.gravity_law import GravityChange
from soilml.quantities import NOT_IDENTIFIED_ABOVE, WEAKLY_IDENTIFIED_ABOVE
from soilml.remarks import Remark
from soilml.row_status import Status
from soilml.traction.draws import SoilDraws
from soilml.traction.gravity import LawComparison, compare_laws, draws_at_gravity
from soilml.traction.pull_and_slope import Traction, predict_traction

#: Extrapolation beyond the measured slips (difference) and loads (factor) that is reported.
SLIP_MARGIN, LOAD_FACTOR = 0.1, 1.25
OVERTURNING_SLOPE = 0.7854  # Slope, rad (45 degrees), beyond which vehicles overturn
_NOT_INCLUDED = "all wheels equal, no load transfer, no side slope"  # What no band includes
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


def limitations(pull_error: float | None) -> Remark:
    """What the bands include; `pull_error` is the declared error of the pull, N, if there is one.

    >>> print(limitations(0.4))
    bands include the uncertainty of the soil, the noise and errors of the model (drawbar pull 0.4 N
    before any reading); all wheels equal, no load transfer, no side slope
    """
    if pull_error is None:
        included = "the uncertainty of the soil and the noise, not errors of the model"
    else:
        error = f"drawbar pull {pull_error:.3g} N before any reading"
        included = f"the uncertainty of the soil, the noise and errors of the model ({error})"
    return Remark("band-content", f"bands include {included}; {_NOT_INCLUDED}", severity="note")


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
    yield from _extrapolation(prediction, measured, error_included)
    failed, load = prediction.failed_fraction, prediction.load
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


def _extrapolation(
    prediction: Traction, measured: MeasuredRange, error_included: bool
) -> Iterator[Remark]:
    error = "may be larger here than [discrepancy] says" if error_included else "is not in the band"
    note = f"extrapolated by the model, whose error {error}"
    low, high = measured.slip
    if prediction.slip[-1] > high + SLIP_MARGIN:
        text = f"no slip above {high:.2g} was measured: {note}"
        yield Remark("extrapolated", text)
    if prediction.slip[0] < low - SLIP_MARGIN:
        text = f"no slip below {low:.2g} was measured: {note}"
        yield Remark("extrapolated", text)
    load, (light, heavy) = prediction.load, measured.load
    if load > LOAD_FACTOR * heavy:
        text = f"no load above {heavy:.3g} N was measured, predicted is {load:.3g} N: {note}"
        yield Remark("extrapolated", text)
    if load < light / LOAD_FACTOR:
        text = f"no load below {light:.3g} N was measured, predicted is {load:.3g} N: {note}"
        yield Remark("extrapolated", text)


@dataclass(frozen=True)
class LoadPrediction:
    """Pull and slope under one load, from the posterior and from the prior, with warnings.

    `laws` are answers by each law of gravity, where that is in doubt.
    """

    posterior: Traction
    prior: Traction
    warnings: tuple[Remark, ...]
    laws: LawComparison | None = None

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
    predictions = []
    tested = draws
    if gravity is not None:
        draws, prior = (draws_at_gravity(case, d, gravity) for d in (draws, prior))
    for load in loads:
        _check_carried(case, draws, load, slip, covariates)
        after, before = (predict_traction(case, d, load, slip, covariates) for d in (draws, prior))
        bare = LoadPrediction(after, before, ())
        texts: Iterable[Remark] = prediction_warnings(
            after, bare.remaining_fraction, measured, error_included=draws.errors is not None
        )
        laws = None
        if gravity is not None:
            answers = partial(_answers, case, load, slip, covariates)
            laws = compare_laws(case, tested, gravity, answers)
            texts = [*texts, *([] if laws is None else [laws.remark()])]
        predictions.append(LoadPrediction(after, before, tuple(texts), laws))
    return predictions


def _answers(
    case: Case, load: float, slip: Floats, covariates: Mapping[str, float] | None, draws: SoilDraws
) -> dict[str, Floats]:
    """What laws of gravity are compared by: draws (n,), in the unit that is printed."""
    found = predict_traction(case, draws, load, slip, covariates)
    middle = len(slip) // 2 - 1
    return {
        "largest_pull_N": found.largest_pull,
        "steepest_deg": np.rad2deg(found.steepest_slope),
        f"sinkage_mm_slip_{slip[middle]:.2g}": 1e3 * found.sinkage[:, middle],
    }


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
