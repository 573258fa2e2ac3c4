"""Pull and slope from a case and a table of rows, with warnings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.operating_points import operating_points
from soilml.io.read_table import Rows, as_table
from soilml.onboard.estimator import Estimator
from soilml.physics.operating_point import COVARIATES
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.traction.by_load import LoadPrediction, measured_loads, predictions_by_load, slip_grid
from soilml.traction.measured_soil import measured_soil
from soilml.traction.messages import MeasuredRange, limitations
from soilml.traction.pull_and_slope import EXCLUDED_KINDS
from soilml.traction.pull_discrepancy import draw_pull_discrepancy
from soilml.traction.soil_draws import prior_draws

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
    warnings: tuple[Remark, ...]

    def plot(self, ax: Any = None) -> NDArray[Any]:
        """Draw pull (N) and slope (degrees) against slip with 90 % bands, a column for each load.

        Parameters
        ----------
        ax
            Axes of matplotlib, two for each load: pull first, then slopes; a new figure where None.

        Returns
        -------
        ndarray of Axes, shape (2, loads)

        Raises
        ------
        InputError
            For another number of axes.
        """
        from soilml.traction.plot import plot_pull

        return plot_pull(self, ax)


def pull_report(
    case: Case,
    table: Rows,
    *,
    free: Sequence[str] | None = None,
    loads: Sequence[float] | None = None,
    slip_limit: float | None = None,
    estimator: Estimator | None = None,
    as_usual: bool = False,
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
    as_usual
        Whether sensors and model have the errors that they usually have, as in `identify`; not
        with an estimator.

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
    table = as_table(table)
    soil = measured_soil(case, table, free, estimator, as_usual)
    draws, unknown, warnings = soil.draws, soil.unknown, list(soil.warnings)
    excluded = [e.name for e in case.model.effects if e.about.kind in EXCLUDED_KINDS]
    if excluded:
        text = f"effects of rig and sensors are excluded: {', '.join(excluded)}"
        warnings.append(Remark("effects-excluded", text, tuple(excluded), "note"))
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
    error = draw_pull_discrepancy(case, table, draws, loads, slip, noise_scale=soil.noise_scale)
    predictions = predictions_by_load(
        case, draws, prior_draws(unknown, case=case), loads, slip, measured_range, covariates, error
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
