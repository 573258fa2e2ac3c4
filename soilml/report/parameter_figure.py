"""Estimates of parameters with their intervals, beside the prior: a panel for each parameter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.report.figure_style import AFTER, PRIOR, short_label, take_axes
from soilml.report.numbers import parameter_name, pretty, shown_unit, with_unit
from soilml.report.report import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes


Floats = NDArray[np.float64]

MOST_LINES = 12  # Most results that are lines with labels; more are points over their number
_LONG = 41  # Characters of a label from which on all are small, so that room is left for the panels


@dataclass(frozen=True)
class ParameterIntervals:
    """Estimates of p parameters in g results, in SI units.

    names, units: Of the parameters (p,).
    labels: Of the results (g,).
    values, low, high: Estimates and ends of their 90 % intervals, (g, p); NaN where there is none.
    prior_low, prior_high: Ends of what was known before, (p,); NaN where that is not stated.
    """

    names: Sequence[str]
    units: Sequence[str]
    labels: Sequence[str]
    values: Floats
    low: Floats
    high: Floats
    prior_low: Floats
    prior_high: Floats

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of axes."""
        return len(self.names), 1

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of a figure, inches."""
        lines = min(max(len(self.labels), 1), MOST_LINES)
        height = 0.95 + 0.28 * (lines - 1) if len(self.labels) <= MOST_LINES else 1.9
        return 7.2, height * len(self.names) + 0.25

    def plot(self, ax: Any = None) -> NDArray[Any]:
        """Draw a panel for each parameter; returns axes (p,), `ax` takes as many."""
        axes = take_axes(ax, len(self.names), 1, self.size)[:, 0]
        for k, panel in enumerate(axes):
            self._draw(panel, k)
        return np.asarray(axes)

    def picture(self) -> Picture:
        """The figure with its caption."""
        caption = "Grey: the range of the prior." if np.isfinite(self.prior_low).any() else ""
        text = f"Estimates and 90 % intervals of {', '.join(map(parameter_name, self.names))}"
        return Picture(
            "Estimates and 90 % intervals", self.plot, *self.shape, self.size, text, caption
        )

    def _draw(self, panel: Axes, k: int) -> None:
        from matplotlib.ticker import MaxNLocator

        scale = [v for v in (*self.values[:, k], self.prior_high[k]) if np.isfinite(v)]
        factor, unit = shown_unit(self.units[k], max(map(abs, scale), default=1.0))
        value, low, high = (factor * v[:, k] for v in (self.values, self.low, self.high))
        prior = factor * self.prior_low[k], factor * self.prior_high[k]
        many = len(self.labels) > MOST_LINES
        place = np.arange(1, len(self.labels) + 1)
        known = np.isfinite(value)
        errors = np.maximum(np.stack([value - low, high - value]), 0.0)[:, known]
        style: dict[str, Any] = {"color": AFTER, "elinewidth": 1.2 if many else 3, "lw": 0}
        if many:
            panel.errorbar(place[known], value[known], errors, fmt=".", ms=4, **style)
            if np.isfinite(prior).all():
                panel.axhspan(*prior, color=PRIOR, lw=0, zorder=0)
            panel.set_ylabel(pretty(unit))
            panel.xaxis.set_major_locator(MaxNLocator(integer=True))
            panel.set_xlabel("number of the result" if k == len(self.names) - 1 else "")
        else:
            panel.errorbar(value[known], place[known], xerr=errors, fmt="o", ms=6, **style)
            if np.isfinite(prior).all():
                panel.axvspan(*prior, color=PRIOR, lw=0, zorder=0)
            panel.set_ylim(len(self.labels) + 0.6, 0.4)
            shown = [short_label(label) for label in self.labels] if len(place) > 1 else []
            panel.set_yticks(place if shown else [], shown)
            if max(map(len, shown), default=0) > _LONG:
                panel.tick_params(axis="y", labelsize=8)
        panel.set_title(pretty(with_unit(parameter_name(self.names[k]), unit)))
