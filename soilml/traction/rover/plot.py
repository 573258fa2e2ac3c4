"""A rover on slopes: slip, margin and energy with bands, and the steepest slope."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.quantiles import quantile_band
from soilml.report.figure_style import take_axes
from soilml.traction.plot import POSTERIOR, PRIOR

if TYPE_CHECKING:
    from soilml.traction.rover.report import RoverReport

Floats = NDArray[np.float64]


#: Width and height of the figure, inches.
SIZE = (10.0, 6.4)


def plot_rover(report: RoverReport, ax: Any = None) -> NDArray[Any]:
    """Draw slip, margin and energy against the slope, and the steepest slope; see `take_axes`."""
    found = report.performance
    panels = take_axes(ax, 2, 2, SIZE)
    degrees = np.rad2deg(found.slope)
    _band(panels[0, 0], degrees, found.slip, "slip needed")
    _band(panels[0, 1], degrees, found.margin, "margin of pull, N")
    panels[0, 1].axhline(0.0, color="#888888", lw=0.8)
    _band(panels[1, 0], degrees, found.energy, "work of the wheels, J/m")
    for panel in panels.flat[:3]:
        panel.set_xlabel("slope, degrees")
    last = panels[1, 1]
    known = [np.rad2deg(v[np.isfinite(v)]) for v in (report.prior_steepest, found.steepest_slope)]
    bins = np.histogram_bin_edges(np.concatenate(known), 40) if any(map(len, known)) else 10
    for values, color, label in zip(
        known, (PRIOR, POSTERIOR), ("before the rows", "after"), strict=True
    ):
        if len(values):
            last.hist(values, bins, density=True, color=color, alpha=0.8, label=label)
    last.set_xlabel("steepest slope, degrees")
    last.set_yticks([])
    last.legend(frameon=False)
    return panels


def _band(panel: Any, x: Floats, draws: Floats, label: str) -> None:
    """Median and 90 % band; slopes that fewer than half of the draws climb have no value."""
    enough = np.mean(np.isfinite(draws), axis=0) >= 0.5
    band = quantile_band(draws[:, enough])
    panel.fill_between(x[enough], band.lower, band.upper, color=POSTERIOR, alpha=0.25, lw=0)
    panel.plot(x[enough], band.middle, "o-", color=POSTERIOR, ms=4)
    panel.set_xlim(x[0], max(x[-1], x[0] + 1e-9))
    panel.set_ylabel(label)
