"""Pull and slope of a rover against slip, with bands and the climbs that were driven."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.report.figure_style import AFTER, BEFORE, take_axes

if TYPE_CHECKING:
    from soilml.systems.climbing.report import ClimbingReport

#: Width and height of the figure, inches.
SIZE = (9.0, 3.8)


def plot_climbing(report: ClimbingReport, ax: Any = None) -> NDArray[Any]:
    """Draw pull (N) and slope (degrees) against slip, with the climbs; see `take_axes`."""
    left, right = axes = take_axes(ax, 1, 2, SIZE)[0]
    slip = report.ability.slip
    for panel, band, factor in (
        (left, report.pull, 1.0),
        (right, report.slope, np.rad2deg(1.0)),
    ):
        panel.fill_between(
            slip, factor * band.lower, factor * band.upper, color=AFTER, alpha=0.3, lw=0,
            label="90 %",
        )  # fmt: skip
        panel.plot(slip, factor * band.middle, color=AFTER, lw=1.4, label="median")
        panel.axhline(0.0, color="#888888", lw=0.7)
        panel.set_xlabel("slip")
    climbs = report.data.climbs
    mean_slip = [0.5 * (c.front.slip + c.rear.slip) for c in climbs]
    right.plot(
        mean_slip, np.rad2deg([c.slope for c in climbs]), "o", color=BEFORE, ms=5,
        label="climbs, mean slip",
    )  # fmt: skip
    left.set_ylabel("drawbar pull on level ground, N")
    right.set_ylabel("slope climbed, degrees")
    right.legend(frameon=False, loc="lower right")
    return np.asarray(axes)
