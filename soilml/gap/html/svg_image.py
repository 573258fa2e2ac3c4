"""Matplotlib figures as SVG images inside the page."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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


@dataclass(frozen=True)
class SvgImage:
    """A figure as a data URI, with its text alternative."""

    image: str
    alt: str


@contextmanager
def report_style() -> Iterator[None]:
    """Matplotlib's defaults with the style of the report, whatever the user's settings are."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        settings: Any = matplotlib.rcParams
        settings.update(_STYLE)
        yield


def new_figure(height: float) -> Figure:
    """A figure of this height in pixels and the width of the report's columns."""
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH / 72, height / 72))


def svg_image(figure: Figure, alt: str) -> SvgImage:
    """The figure as an image; the same figure gives the same bytes."""
    text = io.StringIO()
    without = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(text, format="svg", metadata=without, transparent=True)
    encoded = base64.b64encode(text.getvalue().encode()).decode()
    return SvgImage(f"data:image/svg+xml;base64,{encoded}", alt)
