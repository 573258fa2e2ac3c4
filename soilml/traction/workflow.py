"""Pull and slopes of a wheel or a rover, from a case and a table of rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.given_case import GivenCase, as_case
from soilml.fitting.operating_points import operating_points, with_rover_columns
from soilml.fitting.usable_readings import answered_rows
from soilml.io.read_table import Rows, as_table
from soilml.io.table import Table
from soilml.physics.operating_point import COVARIATES
from soilml.physics.soils.gravity_law import GravityChange
from soilml.quantities import CHANNELS, column
from soilml.traction.prediction import (
    MeasuredRange,
    band_content,
    excluded_effects,
    gravity_remarks,
    measured_loads,
    predicted,
    slip_grid,
)
from soilml.traction.report import PullReport
from soilml.traction.soil_draws import measured_soil
from soilml.traction.vehicle import LARGEST_SLOPE, DrivenVehicle

SLOPES = np.deg2rad([0.0, 5.0, 10.0, 15.0, 20.0])  # Slopes that are looked at by default, rad
#: What no band of one wheel, and none of a rover, includes.
NOT_OF_A_WHEEL = "all wheels equal, no load transfer, no side slope"
NOT_OF_A_ROVER = "all wheels driven at one slip, loads of equally stiff wheels, no side slope"


def pull_report(
    case: GivenCase,
    table: Rows,
    *,
    free: Sequence[str] | None = None,
    loads: Sequence[float] | None = None,
    slopes: Floats | None = None,
    slip_limit: float | None = None,
    exact_model: bool = False,
    gravity: GravityChange | None = None,
) -> PullReport:
    """Pull and slopes of a rover, or of one wheel, on the soil that the rows were measured on.

    Parameters
    ----------
    case
        Model, soil, priors and noise, or the path of a model file. With a rover, the answer is that
        of the rover, unless there are loads.
    table
        Measured rows of one soil, as for `identify`. For a rover, a column `wheel` that names its
        wheels stands for the gear and the pass of a row. Speed, pass number and slip angle of the
        prediction are their medians.
    free
        Paths of the unknown parameters; by default those with a prior.
    loads
        Vertical loads of one wheel, N; by default those of the rows.
    slopes
        From 0 to 60 degrees, rad; by default 0 to 20 degrees in steps of 5, where all wheels stay
        on the ground.
    slip_limit
        Highest slip, in (0, 1); by default the highest measured one, at least 0.6.
    exact_model
        Whether the soil is that of the model taken as exact, and not averaged over explanations as
        in `identify`.
    gravity
        Gravity of the rows and of the prediction, with a law of the soil; loads are those of the
        prediction. By default both are the same.

    Returns
    -------
    PullReport
        Draws of pull (N), slip and slope (rad), by the posterior and the prior.

    Raises
    ------
    InputError
        For a load that the soil does not carry, a slope that no vehicle stands on, or a slip limit
        outside (0, 1).
    FitError, TableError
        As `identify`.
    """
    case, table = as_case(case), as_table(table)
    of_rover = case.rover is not None and loads is None
    if of_rover:
        table = with_rover_columns(case, table)
    whole, (table, _) = table, answered_rows(table)
    measured = MeasuredRange.of(table["slip"], table["load_N"])
    slip = slip_grid(slip_limit, measured)
    if of_rover:
        vehicles = [_rover(case, table, gravity)]
    else:
        known = _covariates(table)
        loads = measured_loads(table["load_N"]) if loads is None else loads
        vehicles = [DrivenVehicle.of_wheel(case, load, known) for load in loads]
    asked = slopes
    if asked is None:
        asked = SLOPES[min(one.steepest for one in vehicles) >= SLOPES]
    asked = np.asarray(asked, dtype=np.float64)
    for one in vehicles:
        one.check_slopes(asked)
    soil = measured_soil(case, whole, free, exact_model)
    case, vehicles = soil.case, [replace(one, case=soil.case) for one in vehicles]
    ends = [0.0] if of_rover else [0.0, LARGEST_SLOPE]  # between which the steepest one is sought
    reached = [np.ravel(one.loads(np.append(asked, ends))) for one in vehicles]
    draws, prior = soil.with_errors(slip, np.concatenate(reached).tolist(), CHANNELS)
    if gravity is not None:
        draws, prior = (d.at_gravity(case, gravity) for d in (draws, prior))
    found = [predicted(one, draws, prior, asked, slip, measured) for one in vehicles]
    key = column("drawbar_pull")
    pull = table[key] if key in table else np.full(len(table), np.nan)
    own = np.isfinite(pull)
    warnings = [*soil.warnings, *excluded_effects(case), *gravity_remarks(case, gravity, of_rover)]
    beside = NOT_OF_A_ROVER if of_rover else NOT_OF_A_WHEEL
    return PullReport(
        len(table), measured, found, (table["slip"][own], table["load_N"][own], pull[own]),
        (*warnings, band_content(prior.errors, beside)), of_rover,
    )  # fmt: skip


def _rover(case: Case, table: Table, gravity: GravityChange | None) -> DrivenVehicle:
    """The rover of a case at the speed of the rows, under the gravity that is asked for."""
    assert case.rover is not None
    if gravity is not None:
        case = replace(case, rover=replace(case.rover, gravity=gravity.target))
    key = column("speed")
    return DrivenVehicle.of_rover(case, float(np.nanmedian(table[key])) if key in table else None)


def _covariates(table: Table) -> dict[str, float]:
    """Medians of speed, pass number and slip angle, where the rows have them."""
    at = operating_points(table)
    known = {field: getattr(at, field) for field in COVARIATES}
    return {field: float(np.median(v)) for field, v in known.items() if v is not None}
