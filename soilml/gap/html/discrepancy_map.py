"""Section "Where the model disagrees": a grid of loads by slips for each channel."""

from __future__ import annotations

import math
from typing import Any

from soilml.gap.results import GapReport
from soilml.report.numbers import channel_name, format_range

#: Scores of the lightest and of the darkest shade, and those shades (red, green, blue).
_LOWEST, _HIGHEST = 1.0, 100.0
_LIGHT, _DARK = (255, 250, 240), (122, 28, 16)
#: Family-wise p value below which a region is marked.
_SIGNIFICANT = 0.05


def discrepancy_maps(report: GapReport) -> list[dict[str, Any]]:
    """The map of each channel, the channel with the largest score first."""
    slips = sorted({w.slip for w in report.where})
    loads = sorted({w.load_N for w in report.where}, reverse=True)
    regions = {(w.channel, w.slip, w.load_N): w for w in report.where}
    heads = [format_range(*slip, digits=2) for slip in slips]
    maps = []
    for name in dict.fromkeys(w.channel for w in report.where):
        rows = []
        for load in loads:
            entries = []
            for slip in slips:
                w = regions.get((name, slip, load))
                entries.append(None if w is None else _entry(w.z, w.p))
            rows.append((format_range(*load), entries))
        maps.append({"channel": channel_name(name), "rows": rows, "slips": heads})
    return maps


def _entry(z: float, p: float) -> dict[str, Any]:
    """One region: its score, its colour and the colour of its text."""
    share = math.log(max(abs(z), _LOWEST) / _LOWEST) / math.log(_HIGHEST / _LOWEST)
    share = min(1.0, share) if math.isfinite(share) else 0.0
    shade = [round(a + share * (b - a)) for a, b in zip(_LIGHT, _DARK, strict=True)]
    # relative luminance (WCAG 2); black and white text have equal contrast at 0.18
    weights = (0.2126, 0.7152, 0.0722)
    luminance = sum(w * (v / 255) ** 2.2 for w, v in zip(weights, shade, strict=True))
    return {
        "z": abs(z),
        "p": p,
        "sure": p < _SIGNIFICANT,
        "side": "above" if z > 0.0 else "below",
        "colour": "#" + "".join(f"{part:02x}" for part in shade),
        "text": "#000000" if luminance > 0.18 else "#ffffff",
    }
