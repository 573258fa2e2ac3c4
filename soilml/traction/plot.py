"""Bands of pull and slope against slip, as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.quantiles import QuantileBand, quantile_band
from soilml.report.figure_style import take_axes
from soilml.traction.by_load import SAME_LOAD

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from soilml.traction.report import PullReport

Floats = NDArray[np.float64]

PRIOR, POSTERIOR, MEASURED = "#d9d9d9", "#005b96", "#cc7a00"


def figure_size(report: PullReport) -> tuple[float, float]:
    """Width and height of the figure, inches."""
    return 1.6 + 3.6 * len(report.by_load), 6.4


def plot_pull(report: PullReport, ax: Any = None) -> NDArray[Any]:
    """Draw a column for each load: pull (N) above and slope (degrees) below; see `take_axes`."""
    count = len(report.by_load)
    panels = take_axes(ax, 2, count, figure_size(report))
    slips, loads, pulls = report.measured_pull
    for i, prediction in enumerate(report.by_load):
        posterior, prior = prediction.posterior, prediction.prior
        top, low = panels[:, i]
        _bands(top, posterior.slip, quantile_band(prior.pull), quantile_band(posterior.pull))
        near = np.abs(loads / posterior.load - 1.0) < SAME_LOAD
        if near.any():
            top.plot(slips[near], pulls[near], "o", color=MEASURED, ms=5, label="measured pull")
        degrees = [
            QuantileBand(*np.rad2deg((b.lower, b.middle, b.upper)))
            for b in map(quantile_band, (prior.slope, posterior.slope))
        ]
        _bands(low, posterior.slip, *degrees)
        best = quantile_band(np.rad2deg(posterior.steepest_slope))
        low.set_title(
            f"steepest {best.middle:.1f}° ({best.lower:.1f} to {best.upper:.1f})", fontsize=10
        )
        top.set_title(f"{posterior.load:.3g} N on the wheel", fontsize=11)
        low.set_xlabel("slip")
    panels[0, 0].set_ylabel("drawbar pull, N")
    panels[1, 0].set_ylabel("slope climbed, degrees")
    for axes in panels.flat:
        axes.plot(
            report.measured_range.slip, [0.0, 0.0], color=MEASURED, lw=5, alpha=0.6,
            label="measured slips", transform=axes.get_xaxis_transform(), solid_capstyle="butt",
        )  # fmt: skip
    for row in panels:
        ends = [end for axes in row for end in axes.get_ylim()]
        for axes in row:
            axes.set_ylim(min(ends), max(ends))
    panels[0, 0].legend(fontsize=9, frameon=False, loc="upper left")
    return panels


def _bands(axes: Axes, slip: Floats, prior: QuantileBand, posterior: QuantileBand) -> None:
    axes.fill_between(slip, prior.lower, prior.upper, color=PRIOR, lw=0, label="90 %, prior")
    axes.fill_between(
        slip,
        posterior.lower,
        posterior.upper,
        color=POSTERIOR,
        alpha=0.55,
        lw=0,
        label="90 %, posterior",
    )
    axes.plot(slip, posterior.middle, color=POSTERIOR, lw=1.2)
    axes.axhline(0.0, color="black", lw=0.6)
    axes.grid(color="#eeeeee", lw=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlim(0.0, 1.03 * float(slip[-1]))
