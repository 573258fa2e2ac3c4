"""The pictures of a report, as SVG to stand inside a page."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.gap.html.formatting import channel, channel_unit, figure, joined
from soilml.gap.results import ReadingsAndPredictions
from soilml.quantities import Z_90

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

#: Before and after: orange and blue, which all eyes and grey paper tell apart.
BEFORE, AFTER, LONE = "#cc7a00", "#005b96", "#4d4d4d"
#: Loads from light to heavy (plasma without its yellow), and markers so that grey will do.
LOADS = ("#0d0887", "#5c01a6", "#9c179e", "#cc4778", "#e0603f", "#d98300")
MARKERS = ("o", "s", "^", "D", "v", "P")
#: Runs drawn at most, the width of a picture in pixels, and the quantile of 90 % of a normal.
MOST_RUNS, WIDTH = 6, 380
_STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
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
class Bar:
    """A line of a bar picture; `after` is nan where there is nothing but before."""

    label: str
    before: float
    after: float


def bars(rows: Sequence[Bar], most: float, least: float, name: str, title: str) -> str:
    """Gap before and after on a log axis; bars start at the noise, which is 1."""
    import matplotlib

    high = 10.0 ** (1.45 * math.log10(max(most, 4.0)) + 0.2)
    low = min(0.5, 0.7 * max(least, 1e-3))
    with matplotlib.rc_context():
        canvas = _figure(30 + 46 * len(rows) + 24)
        axes = canvas.add_axes(
            (0.27, 48 / (54 + 46 * len(rows)), 0.71, 1 - 56 / (54 + 46 * len(rows)))
        )
        for i, row in enumerate(rows):
            pair = [(row.before, BEFORE), (row.after, AFTER)]
            if math.isnan(row.after):
                pair = [(row.before, LONE)]
            for k, (value, colour) in enumerate(pair):
                y = i + (0.0 if len(pair) == 1 else 0.36 * k - 0.18)
                end = min(max(value, low), high) if math.isfinite(value) else 1.0
                axes.barh(y, end - 1.0, 0.3, left=1.0, color=colour)
                axes.plot([end], [y], "|", color=colour, ms=14, mew=2, clip_on=False)
                text = figure(value) if math.isfinite(value) else "not finite"
                axes.annotate(
                    text, (max(end, 1.0), y), xytext=(7, 0), textcoords="offset points",
                    va="center", ha="left", annotation_clip=False,
                    fontweight="bold" if row.label == rows[0].label else "normal",
                )  # fmt: skip
        axes.set_xscale("log")
        axes.set_xlim(low, high)
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.axvline(1.0, color="black", lw=1.2)
        axes.set_yticks(range(len(rows)), [row.label for row in rows])
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        decades = range(math.ceil(math.log10(low)), math.floor(math.log10(high)) + 1)
        step = max(1, math.ceil(len(decades) / 5))
        ticks = [10.0**d for d in decades if d % step == 0]
        axes.set_xticks(ticks, [figure(t, 1) for t in ticks])
        axes.minorticks_off()
        axes.set_xlabel("mean squared residual; line at 1: noise", fontsize=10.5)
        return _svg(canvas, name, title)


@dataclass(frozen=True)
class Shown:
    """A run that is drawn: its name, its load (N) with unit, its colour and its marker."""

    run: str
    load: float
    colour: str
    marker: str


def chosen_runs(curves: ReadingsAndPredictions) -> list[Shown]:
    """Runs spread over the loads that were driven, light first: one a load as long as they last."""
    loads: dict[str, list[float]] = {}
    for run, load in zip(curves.run, curves.load, strict=True):
        loads.setdefault(run, []).append(float(load))
    ordered = sorted((float(np.median(v)), str(k)) for k, v in loads.items())
    lone = {f"{load:.3g}": (load, run) for load, run in reversed(ordered)}
    options = sorted(lone.values()) if len(lone) > 1 else ordered
    picked = np.unique(np.linspace(0, len(options) - 1, MOST_RUNS).round().astype(int))
    few = np.linspace(0, len(LOADS) - 1, len(picked)).round().astype(int)
    return [
        Shown(options[i][1], options[i][0], LOADS[k], MARKERS[j])
        for j, (i, k) in enumerate(zip(picked, few, strict=True))
    ]


def curve(
    curves: ReadingsAndPredictions,
    number: int,
    runs: Sequence[Shown],
    changed: bool,
    name: str,
    title: str,
) -> str:
    """One channel: readings and predictions over slip, and below it what is left, in sigma."""
    import matplotlib

    column = curves.channels[number]
    factor, unit = channel_unit(column)
    with matplotlib.rc_context():
        canvas = _figure(460)
        top = canvas.add_axes((0.14, 0.47, 0.83, 0.475))
        low = canvas.add_axes((0.14, 0.1, 0.83, 0.265), sharex=top)
        names = np.asarray(curves.run)
        for run in runs:
            here = np.flatnonzero((curves.channel == number) & (names == run.run))
            if here.size:
                _drawn(top, curves, here[np.argsort(curves.slip[here])], factor, run, changed)
        top.set_title(joined(channel(column), f"({unit})") if unit else channel(column))
        top.tick_params(labelbottom=False)
        top.margins(y=0.06)
        here = np.flatnonzero(curves.channel == number)
        _left(low, curves, here, changed)
        low.set_xlabel("slip")
        for axes in (top, low):
            axes.grid(color="#e4e4e4", lw=0.7)
            axes.set_axisbelow(True)
        return _svg(canvas, name, title)


def _drawn(
    axes: Axes,
    curves: ReadingsAndPredictions,
    here: NDArray[np.int64],
    factor: float,
    run: Shown,
    changed: bool,
) -> None:
    slip = curves.slip[here]
    band = Z_90 * np.hypot(curves.after_std[here], curves.std[here])
    line = np.unique(slip).size > 1
    for y, dashes in ((curves.before, (4, 2.2)), (curves.after, ())):
        if dashes and not changed:
            continue
        style: dict[str, Any] = {"dashes": dashes} if dashes else {}
        axes.plot(slip, factor * y[here], "-" if line else "_", color=run.colour,
                  lw=1.1 if dashes else 1.7, ms=14, **style)  # fmt: skip
    low, high = factor * (curves.after[here] - band), factor * (curves.after[here] + band)
    if line:
        axes.fill_between(slip, low, high, color=run.colour, alpha=0.18, lw=0)
    else:
        axes.vlines(slip, low, high, color=run.colour, alpha=0.3, lw=5)
    for hidden in (False, True):
        part = here[curves.held_out[here] == hidden]
        axes.plot(curves.slip[part], factor * curves.reading[part], run.marker, color=run.colour,
                  ms=4.6, mew=1.0, mfc="white" if hidden else run.colour)  # fmt: skip


def _left(
    axes: Axes, curves: ReadingsAndPredictions, here: NDArray[np.int64], changed: bool
) -> None:
    axes.axhspan(-Z_90, Z_90, color="#dddddd", lw=0)
    axes.axhline(0.0, color="#555555", lw=0.8)
    most = 3.5
    for y, colour, marker in ((curves.before, BEFORE, "x"), (curves.after, AFTER, "o")):
        if marker == "x" and not changed:
            continue
        left = (curves.reading[here] - y[here]) / curves.std[here]
        axes.plot(curves.slip[here], left, marker, color=colour, ms=3.4 if marker == "o" else 4.5,
                  mew=1.1 if marker == "x" else 0.0)  # fmt: skip
        finite = np.abs(left[np.isfinite(left)])
        most = max(most, 1.3 * float(finite.max()) if finite.size else 0.0)
    squeezed = most > 12.0
    if squeezed:
        axes.set_yscale("symlog", linthresh=3.0)
        steps = [f * 10.0**d for d in range(1, 9) for f in (1.0, 3.0) if f * 10.0**d < most / 1.2]
        ticks = [3.0, *steps[-1:]]
        ticks = [-t for t in ticks] + [0.0, *ticks]
        axes.set_yticks(ticks, [figure(t, 1) for t in ticks])
        axes.minorticks_off()
    axes.set_title("measured − predicted (σ" + (", squeezed beyond 3)" if squeezed else ")"))
    axes.set_ylim(-most, most)


def _figure(height: float) -> Figure:
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcdefaults()
    settings: Any = matplotlib.rcParams
    settings.update(_STYLE)
    return Figure(figsize=(WIDTH / 72, height / 72))


def _svg(canvas: Figure, name: str, title: str) -> str:
    """The picture without what only a file of its own needs, its ids made unlike any other's."""
    import matplotlib

    matplotlib.rcParams["svg.hashsalt"] = name
    text = io.StringIO()
    empty = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    canvas.savefig(text, format="svg", metadata=empty, transparent=True)
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<style type.*?</style>|<!--.*?-->", "", svg, flags=re.S)
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    svg = re.sub(r'(?:xlink:)?href="#', f'href="#{name}-', svg).replace("url(#", f"url(#{name}-")
    svg = re.sub(r"font-family: [^;\"]*; ?", "", svg)
    svg = re.sub(r"font: ([^;\"]*?px) [^;\"]*", r"font: \1 sans-serif", svg)
    svg = re.sub(r' transform="rotate\(-?0 [^"]*"|(?m:^\s+)', "", svg)
    box = re.search(r'viewBox="[^"]*"', svg)
    inside = svg[svg.index(">") + 1 :]
    named = f'role="img" aria-labelledby="{name}"'
    frame = box[0] if box else ""
    return f'<svg {frame} {named}>\n<title id="{name}">{escape(title)}</title>{inside.strip()}\n'
