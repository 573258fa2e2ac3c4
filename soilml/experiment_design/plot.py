"""Maps of the expected remaining fraction of each prior over slip and load of the next row."""

from __future__ import annotations

import os
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.experiment_design.design import Advice
from soilml.io.atomic_files import atomic_output
from soilml.physics.operating_point import Operating
from soilml.report.figure_style import save_png, take_axes

#: Most grid points that are labelled with their value, and most ticks of an axis.
MOST_LABELS, TICKS = 80, 8


def save_maps(path: str | os.PathLike[str], advice: Advice, measured: Operating | None) -> None:
    """Write a PNG file with a map for each parameter; loads in N.

    The frame marks the best point, rings the measured rows. Points at which the wheel might not be
    carried are blank. Channels are those of the first set.
    """
    with atomic_output(path) as part:
        save_png(partial(plot_maps, advice, measured), 1, len(advice.names), _size(advice), part)


def _size(advice: Advice) -> tuple[float, float]:
    return 3.3 * len(advice.names) + 1.2, 3.6


def plot_maps(advice: Advice, measured: Operating | None, ax: Any) -> NDArray[Any]:
    """Draw the maps into axes (parameters,); see `Advice.plot`."""
    from matplotlib.patches import Rectangle

    choices = advice.with_channels(advice.channel_sets[0])
    slips = sorted({c.candidate.slip for c in choices})
    loads = sorted({c.candidate.load for c in choices})
    count = len(advice.names)
    axes = take_axes(ax, 1, count, _size(advice))[0]
    for i, (name, panel) in enumerate(zip(advice.names, axes, strict=True)):
        fraction = np.full((len(loads), len(slips)), np.nan)
        for c in choices:
            cell = loads.index(c.candidate.load), slips.index(c.candidate.slip)
            fraction[cell] = c.remaining_fraction[i]
        image = panel.imshow(
            fraction, origin="lower", aspect="auto", cmap="viridis", vmin=0.0, vmax=1.0
        )
        for (row, col), share in np.ndenumerate(fraction):
            ink = "black" if share > 0.6 else "white"
            if np.isfinite(share) and fraction.size <= MOST_LABELS:
                panel.text(col, row, f"{100 * share:.0f}", ha="center", va="center", color=ink)
        best = advice.best(name).candidate
        corner = slips.index(best.slip) - 0.5, loads.index(best.load) - 0.5
        frame = Rectangle(corner, 1, 1, fill=False, edgecolor="#d62728", linewidth=2.5)
        panel.add_patch(frame)
        if measured is not None:
            slip = np.interp(np.atleast_1d(measured.slip), slips, np.arange(len(slips)))
            load = np.interp(np.atleast_1d(measured.load), loads, np.arange(len(loads)))
            panel.plot(slip, load, "o", color="#d62728", fillstyle="none", markersize=25, mew=2)
        across, up = (range(0, n, -(-n // TICKS)) for n in (len(slips), len(loads)))
        panel.set_xticks(across, [f"{slips[k]:.3g}" for k in across])
        panel.set_yticks(up, [f"{loads[k]:.3g}" for k in up])
        panel.set_title(f"{name.replace('_', ' ')}: now {advice.current_fraction[i]:.0%}")
        panel.set_xlabel("slip of the next row")
    axes[count // 2].set_xlabel("slip (frame: best, rings: measured)")
    axes[0].set_ylabel("load of the next row, N")
    label = "expected remaining fraction of the prior width"
    axes[0].figure.colorbar(image, ax=list(axes)).set_label(label, fontsize=9)
    return np.asarray(axes)
