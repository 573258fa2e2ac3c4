"""A rover's performance on the soil of measured rows, with warnings and a picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.given_case import GivenCase, as_case
from soilml.config.wheeled_rover import GRAVITY
from soilml.errors import InputError
from soilml.fitting.operating_points import with_rover_columns
from soilml.io.read_table import Rows, as_table
from soilml.onboard.estimator import Estimator
from soilml.physics.soils.gravity_law import GravityChange
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.results import Result
from soilml.traction.by_load import LOAD_FACTOR, SLIP_MARGIN, MeasuredRange, slip_grid
from soilml.traction.draws import DrawnErrors, SoilDraws
from soilml.traction.gravity import (
    LawComparison,
    compare_laws,
    draws_at_gravity,
    gravity_remark,
)
from soilml.traction.pull_and_slope import excluded_effects
from soilml.traction.rover_performance import LARGEST_SLOPE, RoverPerformance, rover_performance
from soilml.traction.soil_draws import measured_soil, prior_draws

if TYPE_CHECKING:
    from soilml.report.report import Report

SLOPES = np.deg2rad([0.0, 5.0, 10.0, 15.0, 20.0])  # Slopes that are looked at by default, rad
#: Gravity, m/s^2, and relative difference from it, from which on it is not the Earth's.
EARTH, OTHER_GRAVITY = GRAVITY["earth"], 0.02


@dataclass(frozen=True, repr=False)
class RoverReport(Result):
    """A rover's performance by the posterior, the steepest slope by the prior (rad), warnings."""

    rows: int
    measured_range: MeasuredRange
    performance: RoverPerformance
    prior_steepest: Floats
    warnings: tuple[Remark, ...]
    laws: LawComparison | None = None  # By each law of gravity, where that is in doubt

    def report(self) -> Report:
        """The steepest slope, slip and work by slope, wheels, and what limits them."""
        from soilml.traction.rover_presentation import report_of_rover

        return report_of_rover(self)

    def frame_columns(self) -> dict[str, Any]:
        """A row for each slope: medians and ends of 90 % bands, SI units."""
        from soilml.traction.rover_presentation import rover_columns

        return rover_columns(self)


def rover_report(
    case: GivenCase,
    table: Rows,
    *,
    free: Sequence[str] | None = None,
    slopes: Floats | None = None,
    slip_limit: float | None = None,
    estimator: Estimator | None = None,
    exact_model: bool = False,
    gravity: GravityChange | None = None,
) -> RoverReport:
    """Performance of the case's rover on the soil that the rows were measured on.

    case: With a rover. `soilml.config.case.Case` describes the rest.
    table: Measured rows of one soil. A column `wheel` that names wheels of the rover stands for the
        gear and the pass of its rows.
    free: Paths of the unknown parameters; by default those with a prior.
    slopes: From 0 to 60 degrees, rad; by default 0 to 20 degrees in steps of 5, where all wheels
        stay on the ground.
    slip_limit: Highest slip; by default the highest measured one, at least 0.6.
    estimator: Trained estimator whose estimate replaces the posterior.
    exact_model: Whether the soil is that of the model taken as exact, and not averaged over
        explanations as in `identify`; not with an estimator.
    gravity: Gravity of the rows, and of the rover in place of that of the case, with a law of the
        soil. By default the rows are from where the rover is.

    Raises `InputError` as `rover_performance` does, or for a slip limit outside (0, 1); `FitError`,
    `TableError` as `identify`.
    """
    case = as_case(case)
    if case.rover is None:
        raise InputError("the model file has no [rover]")
    if slopes is None:
        tipping = case.rover.tipping_slope(float(LARGEST_SLOPE))
        slopes = SLOPES[tipping >= SLOPES]
    table = with_rover_columns(case, as_table(table))
    soil = measured_soil(case, table, free, estimator, exact_model)
    case, table = soil.case, table.rows(table.answered)
    if gravity is not None:
        case = with_gravity(case, gravity.target)
    measured = MeasuredRange.of(table["slip"], table["load_N"])
    slip = slip_grid(slip_limit, measured)
    key = column("speed")
    speed = float(np.nanmedian(table[key])) if key in table else None
    draws, prior = soil.draws, prior_draws(soil.unknown, case=case)
    assert case.rover is not None
    loads = np.ravel(case.rover.loads(slopes)).tolist()
    errors = soil.errors(slip, loads, ("drawbar_pull", "torque", "sinkage"))
    if errors is not None:
        draws, prior = replace(draws, errors=errors[0]), replace(prior, errors=errors[1])
    laws = None
    if gravity is not None:
        laws = compare_laws(case, draws, gravity, partial(_answers, case, slip, speed))
        draws, prior = (draws_at_gravity(case, d, gravity) for d in (draws, prior))
    found = rover_performance(case, draws, slopes, slip, speed)
    before = _steepest_before(case, prior, slip, speed)
    warnings = (
        *soil.warnings,
        *([laws.remark()] if laws else []),
        *_warnings(case, found, measured, draws.errors, gravity),
    )
    return RoverReport(len(table), measured, found, before, warnings, laws)


def _answers(case: Case, slip: Floats, speed: float | None, draws: SoilDraws) -> dict[str, Floats]:
    """What laws of gravity are compared by: draws (n,), in the unit that is printed."""
    found = rover_performance(case, draws, np.zeros(1), slip, speed)
    return {
        "steepest_deg": np.rad2deg(found.steepest_slope),
        "margin_N_level": found.margin[:, 0],
        "deepest_mm_level": 1e3 * np.max([of[:, 0] for of in found.sinkage.values()], axis=0),
    }


def with_gravity(case: Case, gravity: float) -> Case:
    """The case with its rover under another gravity, m/s^2."""
    if case.rover is None:
        raise InputError("--gravity needs a model file with [rover]")
    return replace(case, rover=replace(case.rover, gravity=gravity))


def _steepest_before(case: Case, draws: SoilDraws, slip: Floats, speed: float | None) -> Floats:
    """Steepest slope by the prior, (n,); NaN where most of its soils do not carry the rover."""
    try:
        return rover_performance(case, draws, np.zeros(1), slip, speed).steepest_slope
    except InputError:
        return np.full(len(draws.values), np.nan)


def _warnings(
    case: Case,
    found: RoverPerformance,
    measured: MeasuredRange,
    errors: DrawnErrors | None,
    gravity: GravityChange | None,
) -> Iterator[Remark]:
    assert case.rover is not None
    outside = "" if errors else ", whose error is not in the bands"
    loads = np.stack(list(found.loads.values()))
    if loads.max() > LOAD_FACTOR * measured.load[1] or loads.min() < measured.load[0] / LOAD_FACTOR:
        yield Remark(
            "extrapolated",
            f"wheels carry {loads.min():.4g} to {loads.max():.4g} N, measured were "
            f"{measured.load[0]:.4g} to {measured.load[1]:.4g} N: extrapolated by the model"
            f"{outside}",
        )
    if found.slip_limit > measured.slip[1] + SLIP_MARGIN:
        yield Remark(
            "extrapolated",
            f"no slip above {measured.slip[1]:.2g} was measured: extrapolated by the model up "
            f"to {found.slip_limit:.2g}",
        )
    if gravity is not None and gravity.ratio != 1.0:
        yield gravity_remark(gravity)
    elif abs(case.rover.gravity / EARTH - 1.0) > OTHER_GRAVITY:
        yield Remark(
            "other-gravity",
            f"gravity is {case.rover.gravity:.3g} m/s^2, of the rows too: if these are from "
            "elsewhere, the soil may have other parameters (--gravity, --tested-at)",
        )
    tipping = case.rover.tipping_slope(float(LARGEST_SLOPE))
    if np.nanmean(found.steepest_slope > tipping - 1e-3) > 0.05:
        yield Remark("tipping", f"a wheel leaves the ground at {np.rad2deg(tipping):.1f} deg")
    yield from excluded_effects(case)
    included = "the uncertainty of the soil and the noise, not errors of the model"
    if errors is not None:
        names = ", ".join(dict.fromkeys(name for name, _ in errors.functions))
        included = f"the uncertainty of the soil, the noise and errors of the model ({names})"
    yield Remark(
        "band-content",
        f"bands include {included}; all wheels driven at one slip, loads of equally stiff wheels, "
        "no side slope",
        severity="note",
    )
