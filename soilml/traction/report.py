"""Pull and slope from a case and a table of rows, with warnings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.identification.compatibility import check_wheel_size
from soilml.identification.data.observations import read_observations
from soilml.identification.data.operating_points import operating_points
from soilml.identification.diagnostics import EXCESS_RESIDUALS
from soilml.identification.free_parameters import select_free
from soilml.io.table import Table
from soilml.onboard.estimator import Estimator
from soilml.physics.operating_point import COVARIATES
from soilml.quantities import column
from soilml.traction.by_load import LoadPrediction, measured_loads, predictions_by_load, slip_grid
from soilml.traction.messages import MeasuredRange, limitations
from soilml.traction.onboard_draws import onboard_draws
from soilml.traction.pull_and_slope import EXCLUDED_KINDS
from soilml.traction.pull_discrepancy import draw_pull_discrepancy
from soilml.traction.soil_draws import posterior_draws, prior_draws

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PullReport:
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
    warnings: tuple[str, ...]


def pull_report(
    case: Case,
    table: Table,
    *,
    free: Sequence[str] | None = None,
    loads: Sequence[float] | None = None,
    slip_limit: float | None = None,
    estimator: Estimator | None = None,
) -> PullReport:
    """Pull and slope of a gear on the soil that the rows were measured on.

    Parameters
    ----------
    case
        Model, soil, priors and noise.
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
        As `identify` with the posterior method.
    """
    warnings: list[str] = []
    noise_scale = None
    if estimator is None:
        unknown = select_free(case, free)
        data = read_observations(case, table)
        posterior = posterior_draws(case, data, unknown)
        draws, noise_scale = posterior.draws, posterior.samples.noise_scale
        warnings += data.notes
        if [c.name for c in data.channels] == ["torque"]:
            warnings.append(
                "torque alone hardly reveals errors of the model: measure pull or sinkage too"
            )
        if posterior.samples.noise_inflated:
            allowed = f"{EXCESS_RESIDUALS}{' and discrepancy' if case.discrepancy else ''}"
            warnings.append(
                f"residuals are {posterior.samples.noise_scale:.1f} {allowed}: the model lacks an "
                "effect or the noise is understated; bands are widened and may be biased"
            )
    else:
        check_wheel_size(case, table)
        unknown, draws, notes = onboard_draws(estimator, case, table.rows(table.answered))
        warnings += notes
    excluded = [e.name for e in case.model.effects if e.about.kind in EXCLUDED_KINDS]
    if excluded:
        warnings.append(f"effects of rig and sensors are excluded: {', '.join(excluded)}")
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
    error = draw_pull_discrepancy(case, table, draws, loads, slip, noise_scale=noise_scale)
    predictions = predictions_by_load(
        case, draws, prior_draws(unknown), loads, slip, measured_range, covariates, error
    )
    key = column("drawbar_pull")
    pull = table[key] if key in table else np.full(len(table), np.nan)
    known = np.isfinite(pull)
    measured_pull = table["slip"][known], table["load_N"][known], pull[known]
    return PullReport(
        len(table),
        measured_range,
        predictions,
        measured_pull,
        (*warnings, limitations(None if error is None else error.amplitude)),
    )
