"""Matplotlib figures as SVG images inside the page."""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.optional_imports import load_matplotlib, quiet_matplotlib

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Before and after: orange and blue, which colour-blind readers and grey prints distinguish.
BEFORE, AFTER, UNCHANGED = "#cc7a00", "#005b96", "#4d4d4d"
#: Width of a figure in pixels.
WIDTH = 380
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
    "xtick.color": "#333333",
    "ytick.color": "#333333",
    "axes.unicode_minus": True,
}


#: Characters of a long label at its beginning and its end, which says what kind of answer it is.
_HEAD, _TAIL = 20, 35


@dataclass(frozen=True)
class SvgImage:
    """A figure as a data URI, with its text alternative."""

    image: str
    alt: str


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


def new_figure(height: float) -> Figure:
    """A figure of this height in pixels and the width of the report's columns."""
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH / 72, height / 72))


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


def picture(
    draw: Callable[[Any], object], rows: int, columns: int, size: tuple[float, float], alt: str
) -> SvgImage:
    """The image of a figure with axes (rows, columns), size in inches, which `draw` fills."""
    with report_style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=size, layout="constrained")
        draw(figure.subplots(rows, columns, squeeze=False))
        return svg_image(figure, alt)


def save_png(
    draw: Callable[[Any], object],
    rows: int,
    columns: int,
    size: tuple[float, float],
    path: str | os.PathLike[str],
) -> None:
    """The same figure as a PNG file."""
    with report_style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=size, layout="constrained")
        draw(figure.subplots(rows, columns, squeeze=False))
        figure.savefig(path, format="png", dpi=110, metadata={"Software": "soilml"})


def svg_image(figure: Figure, alt: str) -> SvgImage:
    """The figure as an image; the same figure gives the same bytes."""
    text = io.StringIO()
    without = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(text, format="svg", metadata=without, transparent=True)
    encoded = base64.b64encode(text.getvalue().encode()).decode()
    return SvgImage(f"data:image/svg+xml;base64,{encoded}", alt)
