"""Where a model disagrees, as a map over slip and load, and the size of the gap as bars."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from soilml.quantities import Z_90
from soilml.report.figure_style import AFTER, BEFORE, LOADS, UNCHANGED
from soilml.report.numbers import (
    channel_name,
    channel_unit,
    format_range,
    format_residual,
    pretty,
    significant,
)
from soilml.report.report import Picture

if TYPE_CHECKING:
    from soilml.config.remainder import Remainder, RemainderPart
    from soilml.gap.results import GapReduction, GapReport

_SIGNIFICANT = 0.05  # Family-wise p value below which a region is marked
_MOST_SCORE, _DARK = 30.0, 8.0  # Score of the darkest colour, and from which it is dark, in sigma
#: Red where measured above the model, blue below; texts keep their colour on them in a dark page.
_MAP, _TEXT = "RdBu_r", ("#010101", "#fdfdfd")


def map_picture(found: GapReport) -> Picture:
    """Scores of regions of slip and load against the soil alone, a panel for each channel."""
    channels = list(dict.fromkeys(region.channel for region in found.where))
    worst = found.where[0]
    alt = (
        f"scores by slip and load; the largest is {significant(worst.z, 2)} sigma, "
        f"{channel_name(worst.channel)} at slip {format_range(*worst.slip)} and "
        f"{format_range(*worst.load_N)} N"
    )
    caption = (
        "Scores, in sigma, of the readings of a range of slip and load against the soil alone. "
        "Red: measured above the model. Blue: below. *: p < 0.05, corrected for all regions."
    )
    size = (4.0 * len(channels), 3.4)
    draw = partial(_draw_map, found, channels)
    return Picture("Where the model disagrees", draw, 1, len(channels), size, alt, caption)


def _draw_map(found: GapReport, channels: list[str], axes: Any) -> None:
    from matplotlib.colors import SymLogNorm

    slips = sorted({region.slip for region in found.where})
    loads = sorted({region.load_N for region in found.where})
    scale = SymLogNorm(1.0, vmin=-_MOST_SCORE, vmax=_MOST_SCORE, clip=True)
    for channel, panel in zip(channels, axes.flat, strict=True):
        grid = np.full((len(loads), len(slips)), np.nan)
        for region in (one for one in found.where if one.channel == channel):
            i, k = slips.index(region.slip), loads.index(region.load_N)
            grid[k, i] = region.z
            text = f"{'*' if region.p < _SIGNIFICANT else ''}{significant(region.z, 2)}"
            ink = _TEXT[int(abs(region.z) > _DARK)]
            panel.text(i, k, pretty(text), ha="center", va="center", color=ink, fontsize=10)
        panel.imshow(grid, cmap=_MAP, norm=scale, origin="lower", aspect="auto")
        panel.set_title(channel_name(channel))
        panel.grid(visible=False)
        ends = [format_range(*slip, digits=2).replace(" to ", "–") for slip in slips]
        panel.set_xticks(range(len(slips)), ends, fontsize=8)
        ends = [format_range(*load).replace(" to ", "–") for load in loads]
        panel.set_yticks(range(len(loads)), ends)
        panel.set_xlabel("slip")
        panel.set_ylabel("load, N")


def bars_picture(found: GapReport, parts: Mapping[str, str]) -> Picture:
    """Mean squared residuals of each part of the rows before and after, on one logarithmic axis."""
    most = max(len(part.channels) for part in found.gap.values()) + 1
    said = [
        f"{parts.get(key, key)}: {format_residual(part.before)} before"
        + (f", {format_residual(part.after)} after" if part.shrinks else "")
        for key, part in found.gap.items()
    ]
    caption = (
        "Mean squared residual in sigma, on a logarithmic axis; the line at 1 is noise alone. "
        "Orange: the soil alone. Blue: with what was added. Grey: not smaller after."
    )
    size = (4.4 * len(found.gap), 0.9 + 0.55 * most)
    draw = partial(_draw_bars, found.gap, parts)
    return Picture("Size of the gap", draw, 1, len(found.gap), size, "; ".join(said), caption)


def _draw_bars(gap: Mapping[str, GapReduction], parts: Mapping[str, str], axes: Any) -> None:
    every = [[(part.before, part.after), *part.channels.values()] for part in gap.values()]
    values = [value for pairs in every for pair in pairs for value in pair]
    for (key, part), pairs, panel in zip(gap.items(), every, axes.flat, strict=True):
        names = ["all readings", *map(channel_name, part.channels)]
        shown = [pair if part.shrinks else (pair[0], math.nan) for pair in pairs]
        draw_bars(panel, dict(zip(names, shown, strict=True)), values)
        panel.set_title(parts.get(key, key))


def draw_bars(panel: Any, rows: Mapping[str, tuple[float, float]], values: Sequence[float]) -> None:
    """Draw pairs of gaps as bars that start at 1, which is noise alone, on a logarithmic axis.

    rows: Before and after by name; NaN after where it is not smaller. values: All that the axis
        spans.
    """
    known = [value for value in values if math.isfinite(value)]
    high = 10.0 ** (1.45 * math.log10(max([4.0, *known])) + 0.2)
    low = min([0.5, *(0.7 * max(value, 1e-3) for value in known)])
    for i, (before, after) in enumerate(rows.values()):
        pair = [(before, BEFORE, -0.18), (after, AFTER, 0.18)]
        for value, colour, shift in [(before, UNCHANGED, 0.0)] if math.isnan(after) else pair:
            end = float(np.clip(value, low, high)) if math.isfinite(value) else 1.0
            panel.barh(i + shift, end - 1.0, 0.3, left=1.0, color=colour)
            panel.annotate(
                format_residual(value), (max(end, 1.0), i + shift), xytext=(5, 0),
                textcoords="offset points", va="center", annotation_clip=False,
            )  # fmt: skip
    panel.set_xscale("log")
    panel.set_xlim(low, high)
    panel.set_ylim(len(rows) - 0.5, -0.5)
    panel.axvline(1.0, color=UNCHANGED, lw=1.2)
    panel.set_yticks(range(len(rows)), list(rows))
    panel.xaxis.set_major_formatter("{x:g}")
    panel.minorticks_off()


#: Loads of the picture of a remainder, over the lightest and the heaviest driven; slips beyond the
#: driven ones; slips of a curve.
_LIGHTER, _HEAVIER, _FURTHER, _SLIPS = 0.6, 1.5, 0.3, 60


def remainder_picture(remainder: Remainder) -> Picture:
    """Mean and 90 % band of the remainder against slip, in and beyond the driven range."""
    parts = list({(part.column, part.gear): part for part in remainder.parts}.values())
    caption = (
        "Mean and 90 % band of what no effect explains, by load. Grey: the driven slips; dashed: "
        "loads that were not driven. Outside, the mean fades to zero, the band to a usual error."
    )
    told = ", ".join(dict.fromkeys(channel_name(part.column) for part in parts))
    size = (4.6 * len(parts), 3.6)
    draw = partial(_draw_remainder, remainder, parts)
    return Picture("The remainder", draw, 1, len(parts), size, f"the remainder of {told}", caption)


def _draw_remainder(remainder: Remainder, parts: Sequence[RemainderPart], axes: Any) -> None:
    for part, panel in zip(parts, axes.flat, strict=True):
        factor, unit = channel_unit(part.column)
        (low, high), (light, heavy) = part.slip, part.load
        slip = np.linspace(min(low, 0.0), min(high + _FURTHER, 0.95), _SLIPS)
        loads = sorted({_LIGHTER * light, light, heavy, _HEAVIER * heavy})
        name = part.column.rpartition("_")[0]
        for load, colour in zip(loads, LOADS[:: len(LOADS) // len(loads)], strict=False):
            mean, std = remainder.mean_and_std(name, slip, load, part.gear)
            driven = light <= load <= heavy
            half = Z_90 * factor * std
            panel.plot(
                slip, factor * mean, "-" if driven else "--", color=colour, label=f"{load:.3g} N"
            )
            panel.fill_between(
                slip, factor * mean - half, factor * mean + half, color=colour, alpha=0.15, lw=0
            )
        panel.axvspan(low, high, color=UNCHANGED, alpha=0.15, lw=0)
        panel.axhline(0.0, color=UNCHANGED, lw=1.0)
        panel.set_title(f"{channel_name(part.column)} {part.gear}".strip())
        panel.set_xlabel("slip")
        panel.set_ylabel(f"remainder, {unit}")
        panel.legend(fontsize=8, frameon=False)
