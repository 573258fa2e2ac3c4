"""The uncertainty of several parameters together: their densities, and those of pairs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.report.figure_style import AFTER, UNCHANGED, take_axes
from soilml.report.numbers import parameter_name, pretty, shown_unit, with_unit
from soilml.report.report import Picture

_LEVELS = (0.5, 0.9)  # Shares of the draws within the contours
_BINS = 24


def corner_picture(names: Sequence[str], units: Sequence[str], draws: Floats) -> Picture:
    """A corner plot of equally likely draws (n, p) in SI units; see `plot_corner`."""
    p = len(names)
    correlation = np.corrcoef(draws.T).reshape(p, p) if p > 1 else np.ones((1, 1))
    pairs = [
        f"{names[i]} and {names[j]} {correlation[i, j]:+.2f}" for i in range(p) for j in range(i)
    ]
    text = f"correlations: {'; '.join(pairs)}" if pairs else f"density of {names[0]}"

    def draw(ax: Any) -> None:
        plot_corner(names, units, draws, ax)

    caption = "Diagonal: densities. Below it: draws of each pair, with contours of 50 and 90 %."
    return Picture("The soil", draw, p, p, (2.5 * p, 2.3 * p), text, caption, whole=True)


def plot_corner(names: Sequence[str], units: Sequence[str], draws: Floats, ax: Any = None) -> Any:
    """Draw densities on the diagonal and pairs below it; axes (p, p), see `take_axes`."""
    p = len(names)
    axes = take_axes(ax, p, p, (2.5 * p, 2.3 * p))
    largest = np.abs(draws).max(axis=0)
    shown = [shown_unit(unit, size) for unit, size in zip(units, largest, strict=True)]
    values = draws * np.asarray([factor for factor, _ in shown])
    labels = [
        with_unit(pretty(parameter_name(n).split()[-1]), pretty(u))
        for n, (_, u) in zip(names, shown, strict=True)
    ]
    for i in range(p):
        for j in range(p):
            panel = axes[i, j]
            if j > i:
                panel.set_axis_off()
                continue
            if i == j:
                panel.hist(values[:, i], _BINS, color=AFTER, alpha=0.7)
                panel.set_yticks([])
                panel.set_title(pretty(parameter_name(names[i])), fontsize=10)
            else:
                _pair(panel, values[:, j], values[:, i])
                if j == 0:
                    panel.set_ylabel(labels[i])
            if i == p - 1:
                panel.set_xlabel(labels[j])
    return axes


def _pair(panel: Any, x: Floats, y: Floats) -> None:
    panel.plot(x, y, ".", color=UNCHANGED, ms=2, alpha=0.35, rasterized=False)
    count, xs, ys = np.histogram2d(x, y, _BINS // 2)
    ordered = np.sort(count.ravel())[::-1]
    above = np.cumsum(ordered) / max(ordered.sum(), 1.0)
    levels = sorted({float(ordered[np.searchsorted(above, share)]) for share in _LEVELS})
    if levels and levels[0] < count.max() and len(set(levels)) == len(levels):
        centres = [0.5 * (e[1:] + e[:-1]) for e in (xs, ys)]
        panel.contour(*centres, count.T, levels=levels, colors=AFTER, linewidths=1.2)
