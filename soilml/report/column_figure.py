"""Pictures: columns of a table in panels, intervals of parameters, the joint density of draws."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.report.figure_style import AFTER, BEFORE, PRIOR, UNCHANGED, short_label
from soilml.report.numbers import (
    parameter_name,
    pretty,
    shown_column,
    shown_unit,
    significant,
    with_unit,
)
from soilml.report.report import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Columns = Mapping[str, Any]
Floats = NDArray[np.float64]

#: Colours of lines, told apart by colour-blind readers (Okabe and Ito 2008).
COLOURS = (AFTER, BEFORE, "#009e73", "#b03a7c", "#56b4e9", UNCHANGED, "#d55e00", "#8a7a00")
_STYLES = ("-", "--", ":", "-.")
_FEW = 15  # Rows of a line up to which each is marked
_MOST_ACROSS = 3


def column_picture(
    columns: Columns,
    x: str,
    panels: Sequence[Sequence[str]],
    lines: Sequence[str] = (),
    *,
    title: str = "The table",
    caption: str = "",
    measured: Columns | None = None,
    points: bool = False,
) -> Picture:
    """Columns of a table against one of them.

    columns: By name, (n,) each, as in a CSV file: `<name>_std` is drawn as an error bar, `_p05` to
        `_p95` as a band, and `_prior_p05` to `_prior_p95` in grey.
    x: Name of the column along the axis.
    panels: Names of the columns of each panel.
    lines: Names of columns whose values tell lines apart.
    measured: Readings of the same quantities, which are drawn as points.
    points: Draw the columns as points too, without lines.
    """
    across = 2 if len(panels) == 4 else min(len(panels), _MOST_ACROSS)
    rows = -(-len(panels) // across)
    names = ", ".join(shown_column(name)[1] for names in panels for name in names)
    draw = partial(_draw, columns, x, panels, lines, measured or {}, points)
    size = (1.0 + 3.9 * across, 0.6 + 3.1 * rows)
    text = f"{names} against {shown_column(x)[1]}"
    return Picture(title, draw, rows, across, size, text, caption)


def _draw(
    columns: Columns,
    x: str,
    panels: Sequence[Sequence[str]],
    lines: Sequence[str],
    measured: Columns,
    points: bool,
    axes: Any,
) -> None:
    groups = list(_groups(columns, x, lines))
    for k, panel in enumerate(axes.flat):
        if k >= len(panels):
            panel.set_axis_off()
            continue
        names = panels[k]
        for i, (said, rows) in enumerate(groups):
            for j, name in enumerate(names):
                # colours tell lines apart, or the columns of the one line
                colour = COLOURS[(i if said else j) % len(COLOURS)]
                label = said if said and j == 0 else "" if said else _words(name)
                style = "" if points else _STYLES[j * bool(said) % 4]
                _line(panel, columns, x, name, rows, colour, style, label)
        for j, name in enumerate(names):
            if name in measured:
                panel.plot(
                    *_shown(measured, x, name), "o", color=COLOURS[1], ms=4, mfc="none",
                    label="measured", zorder=3,
                )  # fmt: skip
            if len(names) > 1 and groups[0][0]:
                panel.plot([], [], color=UNCHANGED, ls=_STYLES[j % 4], label=_words(name))
        panel.set_xlabel(pretty(shown_column(x)[1]))
        panel.set_ylabel(_shared_label([pretty(shown_column(name)[1]) for name in names]))
        labels = panel.get_legend_handles_labels()[1]
        if len(names) > 1 or (k == 0 and (lines or len(labels) > 1)):
            panel.legend()


def _line(
    panel: Any,
    columns: Columns,
    x: str,
    name: str,
    rows: NDArray[np.int64],
    colour: str,
    style: str,
    label: str,
) -> None:
    at = rows[np.argsort(np.asarray(columns[x], float)[rows], kind="stable")]
    places, values = (v[at] for v in _shown(columns, x, name))
    for ending, shade, alpha in (("_prior", PRIOR, 1.0), ("", colour, 0.2)):
        ends = [columns.get(f"{name}{ending}{end}") for end in ("_p05", "_p95")]
        if all(end is not None for end in ends):
            low, high = (shown_column(name)[0] * np.asarray(end, float)[at] for end in ends)
            said = "90 %, prior" if ending and not rows[0] else ""
            panel.fill_between(places, low, high, color=shade, alpha=alpha, lw=0, label=said)
    std = columns.get(f"{name}_std")
    errors = None if std is None else shown_column(name)[0] * np.asarray(std, float)[at]
    marker = "o" if at.size <= _FEW or not style else ""
    panel.errorbar(
        places, values, errors, color=colour, ls=style, marker=marker, ms=4, lw=1.4, capsize=2,
        label=label,
    )  # fmt: skip


def _shown(columns: Columns, x: str, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places and values (n,) in the units of the axes."""
    parts = [shown_column(key)[0] * np.asarray(columns[key], float) for key in (x, name)]
    return parts[0], parts[1]


def _words(name: str) -> str:
    return shown_column(name)[1].partition(",")[0]


def _groups(
    columns: Columns, x: str, lines: Sequence[str]
) -> Iterator[tuple[str, NDArray[np.int64]]]:
    """What tells the rows of a line apart, and their positions."""
    count = len(np.asarray(columns[x]))
    keys = [tuple(_cell(name, columns[name][i]) for name in lines) for i in range(count)]
    for key in dict.fromkeys(keys):
        rows = np.asarray([i for i, own in enumerate(keys) if own == key], dtype=np.int64)
        yield ", ".join(part for part in key if part), rows


def _shared_label(labels: Sequence[str]) -> str:
    """What the labels of one axis share: words and unit; the shortest where they share none.

    >>> _shared_label(["front share", "rear share"]), _shared_label(["pull, N", "pull on slope, N"])
    ('share', 'pull, N')
    """
    words, units = zip(*(label.partition(", ")[::2] for label in labels), strict=True)
    shared = [word for word in words[0].split() if all(word in one.split() for one in words)]
    text = " ".join(shared) if shared else min(words, key=len)
    return f"{text}, {units[0]}" if units[0] else text


def _cell(name: str, value: Any) -> str:
    """A value that tells lines apart, with its unit; blank for none."""
    if isinstance(value, str):
        return value
    if np.isnan(value):
        return ""
    factor, label = shown_column(name)
    words, comma, unit = label.partition(", ")
    number = significant(factor * float(value), 3)
    return f"{number} {unit}" if comma else f"{words} {number}"


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

    def picture(self) -> Picture:
        """A panel for each parameter, with its caption."""
        lines = len(self.labels)
        height = 0.95 + 0.28 * (lines - 1) if lines <= MOST_LINES else 1.9
        size = 7.2, height * len(self.names) + 0.25
        caption = "Grey: the range of the prior." if np.isfinite(self.prior_low).any() else ""
        text = f"Estimates and 90 % intervals of {', '.join(map(parameter_name, self.names))}"
        title = "Estimates and 90 % intervals"
        return Picture(title, self._draw, len(self.names), 1, size, text, caption)

    def _draw(self, axes: Any) -> None:
        for k, panel in enumerate(np.ravel(axes)):
            self._draw_parameter(panel, k)

    def _draw_parameter(self, panel: Axes, k: int) -> None:
        scale = [v for v in (*self.values[:, k], self.prior_high[k]) if np.isfinite(v)]
        factor, unit = shown_unit(self.units[k], max(map(abs, scale), default=1.0))
        value, low, high = (factor * v[:, k] for v in (self.values, self.low, self.high))
        prior = factor * self.prior_low[k], factor * self.prior_high[k]
        many = len(self.labels) > MOST_LINES
        place = np.arange(1, len(self.labels) + 1)
        known = np.isfinite(value)
        errors = np.maximum(np.stack([value - low, high - value]), 0.0)[:, known]
        panel.errorbar(
            value[known], place[known], xerr=errors, color=AFTER, lw=0, fmt="." if many else "o",
            ms=4 if many else 6, elinewidth=1.2 if many else 3,
        )  # fmt: skip
        if np.isfinite(prior).all():
            panel.axvspan(*prior, color=PRIOR, lw=0, zorder=0)
        panel.set_ylim(len(self.labels) + 0.6, 0.4)
        if many:
            panel.set_ylabel("number")
        else:
            shown = [short_label(label) for label in self.labels] if len(place) > 1 else []
            panel.set_yticks(place if shown else [], shown)
            if max(map(len, shown), default=0) > _LONG:
                panel.tick_params(axis="y", labelsize=8)
        panel.set_title(pretty(with_unit(parameter_name(self.names[k]), unit)))


_LEVELS = (0.5, 0.9)  # Shares of the draws within the contours
_BINS = 24


def corner_picture(names: Sequence[str], units: Sequence[str], draws: Floats) -> Picture:
    """A corner plot of equally likely draws (n, p) in SI units: densities, and pairs below them."""
    p = len(names)
    correlation = np.corrcoef(draws.T).reshape(p, p) if p > 1 else np.ones((1, 1))
    pairs = [
        f"{names[i]} and {names[j]} {correlation[i, j]:+.2f}" for i in range(p) for j in range(i)
    ]
    text = f"correlations: {'; '.join(pairs)}" if pairs else f"density of {names[0]}"
    draw = partial(_draw_corner, names, units, draws)
    caption = "Diagonal: densities. Below it: draws of each pair, with contours of 50 and 90 %."
    return Picture("The soil", draw, p, p, (2.5 * p, 2.3 * p), text, caption, whole=True)


def _draw_corner(names: Sequence[str], units: Sequence[str], draws: Floats, axes: Any) -> None:
    """Draw into axes (p, p)."""
    p = len(names)
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


def _pair(panel: Any, x: Floats, y: Floats) -> None:
    panel.plot(x, y, ".", color=UNCHANGED, ms=2, alpha=0.35, rasterized=False)
    count, xs, ys = np.histogram2d(x, y, _BINS // 2)
    ordered = np.sort(count.ravel())[::-1]
    above = np.cumsum(ordered) / max(ordered.sum(), 1.0)
    levels = sorted({float(ordered[np.searchsorted(above, share)]) for share in _LEVELS})
    if levels and levels[0] < count.max() and len(set(levels)) == len(levels):
        centres = [0.5 * (e[1:] + e[:-1]) for e in (xs, ys)]
        panel.contour(*centres, count.T, levels=levels, colors=AFTER, linewidths=1.2)
