"""Pull and slope from a case and a table of rows, with warnings and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.given_case import GivenCase, as_case
from soilml.fitting.operating_points import operating_points
from soilml.io.read_table import Rows, as_table
from soilml.onboard.estimator import Estimator
from soilml.physics.operating_point import COVARIATES
from soilml.physics.soils.gravity_law import GravityChange
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.results import Result
from soilml.traction.by_load import (
    LoadPrediction,
    MeasuredRange,
    limitations,
    measured_loads,
    predictions_by_load,
    slip_grid,
)
from soilml.traction.gravity import gravity_remark
from soilml.traction.model_errors import ON_SLOPES
from soilml.traction.pull_and_slope import excluded_effects
from soilml.traction.soil_draws import measured_soil, prior_draws

if TYPE_CHECKING:
    from soilml.report.report import Report


@dataclass(frozen=True, repr=False)
class PullReport(Result):
    """Predictions under each load.

    Attributes
    ----------
    rows
        Number of rows.
    measured_range
        Slips and loads of the rows.
    by_load
        Prediction under each load.
    measured_pull
        Slip, load (N) and drawbar pull (N) of the k rows that measured it, (k,) each.
    warnings
        Those that hold for all loads.
    """

    rows: int
    measured_range: MeasuredRange
    by_load: list[LoadPrediction]
    measured_pull: tuple[Floats, Floats, Floats]
    warnings: tuple[Remark, ...]

    def report(self) -> Report:
        """Largest pull and steepest slope under each load, their curves, and what limits them."""
        from soilml.traction.presentation import report_of_pull

        return report_of_pull(self)

    def frame_columns(self) -> dict[str, Any]:
        """A row for each load and slip: medians and ends of 90 % bands, SI units."""
        from soilml.traction.presentation import pull_columns

        return pull_columns(self)


def pull_report(
    case: GivenCase,
    table: Rows,
    *,
    free: Sequence[str] | None = None,
    loads: Sequence[float] | None = None,
    slip_limit: float | None = None,
    estimator: Estimator | None = None,
    exact_model: bool = False,
    gravity: GravityChange | None = None,
) -> PullReport:
    """Pull and slope of a gear on the soil that the rows were measured on.

    Parameters
    ----------
    case
        Model, soil, priors and noise, or the path of a model file.
    table
        Measured rows of one soil, as for `identify`. Speed, pass number and slip angle of the
        prediction are their medians.
    free
        Paths of the unknown parameters; by default those with a prior.
    loads
        Vertical loads, N; by default those of the rows.
    slip_limit
        Highest slip, in (0, 1); by default the highest measured one, at least 0.6.
    estimator
        Trained estimator whose estimate replaces the posterior.
    exact_model
        Whether the soil is that of the model taken as exact, and not averaged over explanations as
        in `identify`; not with an estimator.
    gravity
        Gravity of the rows and of the prediction, with a law of the soil; loads are those of the
        prediction. By default both are the same.

    Returns
    -------
    PullReport
        Draws of pull (N) and slope (rad) under each load, for the posterior and the prior.

    Raises
    ------
    InputError
        For a load that the soil does not carry, a slip limit outside (0, 1), or an estimator for
        another gear.
    FitError, TableError
        As `identify`.
    """
    case, table = as_case(case), as_table(table)
    soil = measured_soil(case, table, free, estimator, exact_model)
    case, draws, unknown = soil.case, soil.draws, soil.unknown
    warnings = [*soil.warnings, *excluded_effects(case)]
    table = table.rows(table.answered)
    at = operating_points(table)
    measured_range = MeasuredRange.of(table["slip"], table["load_N"])
    covariates = {
        field: float(np.median(values))
        for field in COVARIATES
        if (values := getattr(at, field)) is not None
    }
    loads = measured_loads(table["load_N"]) if loads is None else loads
    slip = slip_grid(slip_limit, measured_range)
    before, error = prior_draws(unknown, case=case), None
    errors = soil.errors(slip, _on_slopes(loads), ("drawbar_pull",))
    if errors is not None:
        draws, before = replace(draws, errors=errors[0]), replace(before, errors=errors[1])
        error = errors[1].amplitude("drawbar_pull")
    predictions = predictions_by_load(
        case, draws, before, loads, slip, measured_range, covariates, gravity
    )
    if gravity is not None and gravity.ratio != 1.0:
        warnings.append(gravity_remark(gravity))
    key = column("drawbar_pull")
    pull = table[key] if key in table else np.full(len(table), np.nan)
    known = np.isfinite(pull)
    measured_pull = table["slip"][known], table["load_N"][known], pull[known]
    return PullReport(
        len(table),
        measured_range,
        predictions,
        measured_pull,
        (*warnings, limitations(error)),
    )


def _on_slopes(loads: Sequence[float]) -> list[float]:
    """Loads with the smallest normal component on a slope that errors are asked for."""
    return [*loads, ON_SLOPES * min(loads)]
