"""Bands of pull and slope against slip, as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.quantile_band import QuantileBand, quantile_band
from soilml.traction.by_load import SAME_LOAD
from soilml.traction.report import PullReport

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

PRIOR, POSTERIOR, MEASURED = "#d9d9d9", "#005b96", "#cc7a00"


def save_figure(report: PullReport, path: Path) -> None:
    """Write a PNG file: a column for each load, pull (N) above and slope (degrees) below."""
    from matplotlib.figure import Figure

    count = len(report.by_load)
    figure = Figure(figsize=(1.6 + 3.6 * count, 6.0), layout="constrained")
    panels = figure.subplots(2, count, sharex=True, sharey="row", squeeze=False)
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
    parts: dict[str, Any] = {}
    for axes in panels.flat:
        axes.plot(
            report.measured_range.slip, [0.0, 0.0], color=MEASURED, lw=5, alpha=0.6,
            label="measured slips", transform=axes.get_xaxis_transform(), solid_capstyle="butt",
        )  # fmt: skip
        handles, labels = axes.get_legend_handles_labels()
        parts |= dict(zip(labels, handles, strict=True))
    figure.legend(
        parts.values(), parts.keys(), loc="outside lower center", ncols=4 if count > 1 else 2,
        fontsize=9, frameon=False,
    )  # fmt: skip
    figure.savefig(path, format="png", dpi=130)


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
