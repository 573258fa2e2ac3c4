"""Figures of matplotlib in one style: a caller's axes, PNG files, SVG that follows a page."""

from __future__ import annotations

import html
import io
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.optional_imports import load_matplotlib, quiet_matplotlib

if TYPE_CHECKING:
    from soilml.report.report import Picture

#: Before and after: orange and blue, which colour-blind readers and grey prints distinguish.
BEFORE, AFTER, UNCHANGED = "#cc7a00", "#005b96", "#4d4d4d"
MEASURED, PRIOR, GRID = "#1a1a1a", "#d9d9d9", "#e4e4e4"
#: Colours of loads from light to heavy (the colour map plasma without its yellow).
LOADS = ("#0d0887", "#5c01a6", "#9c179e", "#cc4778", "#e0603f", "#d98300")
#: Colours of figures, and the variables of the page that replace them in its light and dark style.
VARIABLES = {
    "#000000": "ink", MEASURED: "ink", "#555555": "soft", "#333333": "soft", GRID: "line",
    PRIOR: "band", BEFORE: "before", AFTER: "after", UNCHANGED: "lone", "#fefefe": "paper",
} | {colour: f"load{i}" for i, colour in enumerate(LOADS)}  # fmt: skip
_STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "soilml",
    "text.parse_math": False,
    "font.size": 11.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.titlesize": 11.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "xtick.color": "#333333",
    "ytick.color": "#333333",
    "axes.unicode_minus": True,
}
#: Characters of a long label at its beginning and its end, which says what kind of answer it is.
_HEAD, _TAIL = 20, 35
_DROPPED = re.compile(
    r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|<style.*?</style>"
    r'| xmlns(?::\w+)?="[^"]*"',
    re.DOTALL,
)


@contextmanager
def report_style() -> Iterator[None]:
    """Matplotlib's defaults with the style of the report, whatever the user's settings are.

    Its messages do not reach the terminal: a browser has the characters that its fonts lack.
    """
    load_matplotlib()
    import matplotlib

    with quiet_matplotlib(), matplotlib.rc_context():
        matplotlib.rcdefaults()
        settings: Any = matplotlib.rcParams
        settings.update(_STYLE)
        yield


def short_label(text: str) -> str:
    """A label that leaves room for its picture: its beginning and its end.

    >>> short_label(f"run {'a' * 99}, with the usual errors of a model")
    'run aaaaaaaaaaaaaaaa…a, with the usual errors of a model'
    """
    return text if len(text) <= _HEAD + 1 + _TAIL else f"{text[:_HEAD]}…{text[-_TAIL:]}"


def take_axes(ax: Any, rows: int, columns: int, size: tuple[float, float]) -> NDArray[Any]:
    """The axes (rows, columns) that a `plot` method draws into.

    ax: Axes of matplotlib, or a sequence or array of rows times columns of them; None for a new
        figure of pyplot.
    size: Width and height of a new figure, inches.

    Raises `InputError` for another number of axes.
    """
    if ax is None:
        from matplotlib import pyplot

        _, found = pyplot.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained")
        return np.asarray(found)
    given = np.asarray(ax, dtype=object).ravel()
    if given.size != rows * columns:
        raise InputError(
            f"ax is {given.size} axes; this plot needs {rows * columns}, such as those of "
            f"pyplot.subplots({rows}, {columns})"
        )
    return given.reshape(rows, columns)


def save_png(picture: Picture, path: str | os.PathLike[str]) -> None:
    """Write a picture as a PNG file."""
    with report_style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=picture.size, layout="constrained")
        picture.draw(figure.subplots(picture.rows, picture.columns, squeeze=False))
        figure.savefig(path, format="png", dpi=110, metadata={"Software": "soilml"})


def svg_images(picture: Picture, prefix: str) -> list[str]:
    """The elements `svg` of a picture for a page: one for each column of its axes, or of all.

    prefix: Begins their ids, which are unique on a page. Colours of `VARIABLES` become variables of
    the page's style. The same picture gives the same text.
    """
    with report_style():
        from matplotlib.figure import Figure

        images = 1 if picture.whole else picture.columns
        size = (picture.size[0] / images, picture.size[1])
        figures = [Figure(figsize=size, layout="constrained") for _ in range(images)]
        each = picture.columns // images
        axes = [figure.subplots(picture.rows, each, squeeze=False) for figure in figures]
        picture.draw(np.concatenate(axes, axis=1))
        return [
            _inline(figure, picture.alt, f"{prefix}{i}")
            for i, figure in enumerate(figures)
            if any(panel.axison for panel in figure.axes)
        ]


def _inline(figure: Any, alt: str, prefix: str) -> str:
    """A figure as an element without styles of its own, which the rules of a page may forbid."""
    text = io.StringIO()
    without = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(text, format="svg", metadata=without, transparent=True)
    found = _DROPPED.sub("", text.getvalue()).strip()
    found = found.replace("xlink:href", "href").replace(' version="1.1"', "")
    found = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{prefix}-", found)
    found = re.sub(r' style="([^"]*)"', lambda style: _attributes(style[1]), found)
    head = f'<svg role="img" aria-label="{html.escape(alt, quote=True)}"'
    return re.sub(r'^<svg width="[^"]*" height="[^"]*"', head, found, count=1)


def _attributes(style: str) -> str:
    """The declarations of a style as attributes; known colours as variables of the page."""
    parts = []
    for name, value in re.findall(r"([\w-]+): *([^;]+)", style):
        if name == "font":
            weight = ' font-weight="700"' if re.search(r"\b(700|bold)\b", value) else ""
            size = re.search(r"([\d.]+)px", value)
            parts.append(f' font-size="{size[1] if size else 10}"{weight}')
            continue
        colour = VARIABLES.get(value.strip())
        parts.append(f' {name}="{f"var(--{colour})" if colour else value.strip()}"')
    return "".join(parts)
