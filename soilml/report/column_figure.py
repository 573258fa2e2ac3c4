"""Columns of a table as a picture: a panel for each quantity, a line for each group of rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.report.figure_style import AFTER, BEFORE, PRIOR, UNCHANGED
from soilml.report.numbers import pretty, shown_column, significant
from soilml.report.report import Picture

Columns = Mapping[str, Any]

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
) -> Picture:
    """Columns of a table against one of them.

    columns: By name, (n,) each, as in a CSV file: `<name>_std` is drawn as an error bar, `_p05` to
        `_p95` as a band, and `_prior_p05` to `_prior_p95` in grey.
    x: Name of the column along the axis.
    panels: Names of the columns of each panel.
    lines: Names of columns whose values tell lines apart.
    measured: Readings of the same quantities, which are drawn as points.
    """
    across = 2 if len(panels) == 4 else min(len(panels), _MOST_ACROSS)
    rows = -(-len(panels) // across)
    names = ", ".join(shown_column(name)[1] for names in panels for name in names)
    draw = partial(_draw, columns, x, panels, lines, measured or {})
    size = (1.0 + 3.9 * across, 0.6 + 3.1 * rows)
    text = f"{names} against {shown_column(x)[1]}"
    return Picture(title, draw, rows, across, size, text, caption)


def _draw(
    columns: Columns,
    x: str,
    panels: Sequence[Sequence[str]],
    lines: Sequence[str],
    measured: Columns,
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
                _line(panel, columns, x, name, rows, colour, _STYLES[j * bool(said) % 4], label)
        for j, name in enumerate(names):
            if name in measured:
                panel.plot(*_shown(measured, x, name), "o", color=COLOURS[1], ms=4, mfc="none")
            if len(names) > 1 and groups[0][0]:
                panel.plot([], [], color=UNCHANGED, ls=_STYLES[j % 4], label=_words(name))
        panel.set_xlabel(pretty(shown_column(x)[1]))
        panel.set_ylabel(_shared_label([pretty(shown_column(name)[1]) for name in names]))
        if len(names) > 1 or (k == 0 and lines):
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
            panel.fill_between(places, low, high, color=shade, alpha=alpha, lw=0)
    std = columns.get(f"{name}_std")
    errors = None if std is None else shown_column(name)[0] * np.asarray(std, float)[at]
    marker = "o" if at.size <= _FEW else ""
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
