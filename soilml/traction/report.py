"""Pull and slope from a case and a table of rows, with warnings and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.given_case import GivenCase, as_case
from soilml.fitting.operating_points import operating_points
from soilml.io.read_table import Rows, as_table
from soilml.numerics.quantiles import QuantileBand, quantile_band
from soilml.onboard.estimator import Estimator
from soilml.physics.operating_point import COVARIATES
from soilml.physics.pull_efficiency import THRESHOLDS
from soilml.physics.soils.gravity_law import GravityChange
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.figure_style import take_axes
from soilml.results import Result
from soilml.traction.by_load import (
    SAME_LOAD,
    LoadPrediction,
    MeasuredRange,
    limitations,
    measured_loads,
    predictions_by_load,
    slip_grid,
)
from soilml.traction.gravity import gravity_remark
from soilml.traction.model_errors import ON_SLOPES
from soilml.traction.pull_and_slope import Traction, excluded_effects
from soilml.traction.soil_draws import measured_soil, prior_draws

if TYPE_CHECKING:
    from matplotlib.axes import Axes


ROWS = 3  # Panels of each load
PRIOR, POSTERIOR, MEASURED = "#d9d9d9", "#005b96", "#cc7a00"


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

    def plot(self, ax: Any = None) -> NDArray[Any]:
        """Draw pull (N), slope (degrees) and efficiency against slip, a column for each load.

        Bands hold 90 %. `ax`: axes of matplotlib, three for each load: pulls first, then slopes,
        then efficiencies; a new figure where None. Returns the axes, (3, loads). Raises
        `InputError` for another number of axes.
        """
        return plot_pull(self, ax)

    def summary(self) -> str:
        """The largest pull and the steepest slope under each load."""
        from soilml.traction.presentation import load_sentence

        return "\n".join(load_sentence(one) for one in self.by_load)

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


def figure_size(report: PullReport) -> tuple[float, float]:
    """Width and height of the figure, inches."""
    return 1.6 + 3.6 * len(report.by_load), 9.0


def plot_pull(report: PullReport, ax: Any = None) -> NDArray[Any]:
    """Draw a column for each load: pull (N), slope (degrees), efficiency; see `take_axes`."""
    count = len(report.by_load)
    panels = take_axes(ax, ROWS, count, figure_size(report))
    slips, loads, pulls = report.measured_pull
    for i, prediction in enumerate(report.by_load):
        posterior, prior = prediction.posterior, prediction.prior
        top, low, last = panels[:, i]
        _bands(top, posterior.slip, quantile_band(prior.pull), quantile_band(posterior.pull))
        near = np.abs(loads / posterior.load - 1.0) < SAME_LOAD
        if near.any():
            top.plot(slips[near], pulls[near], "o", color=MEASURED, ms=5, label="measured pull")
        degrees = [
            QuantileBand(*np.rad2deg((b.lower, b.middle, b.upper)))
            for b in map(quantile_band, (prior.slope, posterior.slope))
        ]
        _bands(low, posterior.slip, degrees[0], degrees[1])
        best = quantile_band(np.rad2deg(posterior.steepest_slope))
        low.set_title(
            f"steepest {best.middle:.1f}° ({best.lower:.1f} to {best.upper:.1f})", fontsize=10
        )
        top.set_title(f"{posterior.load:.3g} N on the wheel", fontsize=11)
        _draw_efficiencies(last, posterior, prior)
        last.set_xlabel("slip")
    panels[0, 0].set_ylabel("drawbar pull, N")
    panels[1, 0].set_ylabel("slope climbed, degrees")
    panels[2, 0].set_ylabel("efficiency")
    panels[2, 0].legend(fontsize=9, frameon=False, loc="lower right")
    for axes in panels.flat:
        axes.plot(
            report.measured_range.slip, [0.0, 0.0], color=MEASURED, lw=5, alpha=0.6,
            label="measured slips", transform=axes.get_xaxis_transform(), solid_capstyle="butt",
        )  # fmt: skip
    for row in panels[:2]:
        ends = [end for axes in row for end in axes.get_ylim()]
        for axes in row:
            axes.set_ylim(min(ends), max(ends))
    panels[0, 0].legend(fontsize=9, frameon=False, loc="upper left")
    return panels


def _draw_efficiencies(axes: Axes, posterior: Traction, prior: Traction) -> None:
    """Tractive efficiency with its bands; pull efficiency, and the ends of its classes."""
    if posterior.most_efficient is None:
        axes.text(0.5, 0.5, "no efficiency", ha="center", transform=axes.transAxes)
        return
    before, after = (quantile_band(one.tractive_efficiency) for one in (prior, posterior))
    _bands(axes, posterior.slip, before, after, names=False)
    axes.lines[-2].set_label("tractive")
    pull = quantile_band(posterior.pull_efficiency).middle
    axes.plot(posterior.slip, pull, "--", color=POSTERIOR, lw=1.2, label="pull")
    for end in THRESHOLDS:
        axes.axhline(end, color="#777777", lw=0.6, ls=":")
    axes.set_ylim(-0.25, 1.0)


def _bands(
    axes: Axes, slip: Floats, prior: QuantileBand, posterior: QuantileBand, names: bool = True
) -> None:
    said = ("90 %, prior", "90 %, posterior") if names else (None, None)
    axes.fill_between(slip, prior.lower, prior.upper, color=PRIOR, lw=0, label=said[0])
    axes.fill_between(
        slip,
        posterior.lower,
        posterior.upper,
        color=POSTERIOR,
        alpha=0.55,
        lw=0,
        label=said[1],
    )
    axes.plot(slip, posterior.middle, color=POSTERIOR, lw=1.2)
    axes.axhline(0.0, color="black", lw=0.6)
    axes.grid(color="#eeeeee", lw=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlim(0.0, 1.03 * float(slip[-1]))
