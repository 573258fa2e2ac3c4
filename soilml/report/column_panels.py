"""Columns of a table as a picture: a panel for each quantity, a line for each group of rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.report.figure_style import take_axes
from soilml.report.numbers import shown_column, significant

#: Colours of lines, told apart by colour-blind readers (Okabe and Ito 2008).
COLOURS = ("#005b96", "#cc7a00", "#009e73", "#b03a7c", "#56b4e9", "#4d4d4d", "#d55e00", "#8a7a00")
_STYLES = ("-", "--", ":", "-.")
_FEW = 15  # Rows of a line up to which each is marked
_MOST_ACROSS = 3


@dataclass(frozen=True)
class ColumnPanels:
    """Columns of a table against one of them.

    columns: By name, (n,) each, as in a CSV file; `<name>_std` is drawn as an error bar.
    x: Name of the column along the axis.
    panels: Names of the columns of each panel.
    lines: Names of columns whose values tell lines apart.
    """

    columns: Mapping[str, Any]
    x: str
    panels: Sequence[Sequence[str]]
    lines: Sequence[str] = ()

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of axes."""
        across = 2 if len(self.panels) == 4 else min(len(self.panels), _MOST_ACROSS)
        return -(-len(self.panels) // across), across

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of a figure, inches."""
        rows, across = self.shape
        return 1.0 + 3.9 * across, 0.6 + 3.1 * rows

    def plot(self, ax: Any = None) -> NDArray[Any]:
        """Draw a panel for each group of columns; `ax` takes as many axes as `shape` says."""
        axes = take_axes(ax, *self.shape, self.size)
        for k, panel in enumerate(axes.flat):
            if k >= len(self.panels):
                panel.set_axis_off()
                continue
            self._draw(panel, self.panels[k], with_legend=k == 0)
        return axes

    def _draw(self, panel: Any, names: Sequence[str], with_legend: bool) -> None:
        factor, label = shown_column(self.x)
        for i, (said, rows) in enumerate(self._groups()):
            order = rows[np.argsort(np.asarray(self.columns[self.x], float)[rows], kind="stable")]
            for k, name in enumerate(names):
                own, words = shown_column(name)
                std = self.columns.get(f"{name}_std")
                # colours tell lines apart, or the columns of the one line
                panel.errorbar(
                    factor * np.asarray(self.columns[self.x], float)[order],
                    own * np.asarray(self.columns[name], float)[order],
                    yerr=None if std is None else own * np.asarray(std, float)[order],
                    color=COLOURS[(i if said else k) % len(COLOURS)],
                    ls=_STYLES[k % len(_STYLES)] if said else "-",
                    marker="o" if order.size <= _FEW else "",
                    ms=4,
                    lw=1.4,
                    capsize=2,
                    label=(said if k == 0 else "") if said else words.partition(",")[0],
                )
            if said and len(names) > 1 and i == 0:
                for k, name in enumerate(names):
                    words = shown_column(name)[1].partition(",")[0]
                    panel.plot([], [], color="#777777", ls=_STYLES[k % len(_STYLES)], label=words)
        panel.set_xlabel(label)
        panel.set_ylabel(_shared_label([shown_column(name)[1] for name in names]))
        panel.grid(color="#eeeeee", lw=0.7)
        panel.set_axisbelow(True)
        if len(names) > 1 or (with_legend and self.lines):
            panel.legend(fontsize=8, frameon=False)

    def _groups(self) -> Iterator[tuple[str, NDArray[np.int64]]]:
        """What tells the rows of a line apart, and their positions."""
        count = len(np.asarray(self.columns[self.x]))
        if not self.lines:
            yield "", np.arange(count)
            return
        keys = [
            tuple(_cell(name, self.columns[name][i]) for name in self.lines) for i in range(count)
        ]
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
