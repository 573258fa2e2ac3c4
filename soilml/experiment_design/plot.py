"""Maps of what a next row would leave of each parameter, over slip and load."""

from __future__ import annotations

import os

import numpy as np

from soilml.experiment_design.design import Advice
from soilml.io.atomic_files import atomic_output
from soilml.physics.operating_point import Operating

#: Most cells in which the width is written, and most ticks of an axis.
WRITTEN, TICKS = 80, 8


def save_maps(path: str | os.PathLike[str], advice: Advice, driven: Operating | None) -> None:
    """A PNG file: one map for each parameter, of the width left of its prior; loads in N.

    Dark is little left. The frame is the best point, rings are rows driven; blank is where a
    twentieth of the possible soils would not carry the wheel. Channels are those of the first set.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.patches import Rectangle

    choices = advice.of(advice.sets[0])
    slips = sorted({c.candidate.slip for c in choices})
    loads = sorted({c.candidate.load for c in choices})
    count = len(advice.names)
    figure, axes = pyplot.subplots(
        1, count, figsize=(3.3 * count + 1.2, 3.6), sharey=True, squeeze=False, layout="constrained"
    )
    for i, (name, panel) in enumerate(zip(advice.names, axes[0], strict=True)):
        left = np.full((len(loads), len(slips)), np.nan)
        for c in choices:
            place = loads.index(c.candidate.load), slips.index(c.candidate.slip)
            left[place] = c.left[i]
        image = panel.imshow(
            left, origin="lower", aspect="auto", cmap="viridis", vmin=0.0, vmax=1.0
        )
        for (row, col), share in np.ndenumerate(left):
            ink = "black" if share > 0.6 else "white"
            if np.isfinite(share) and left.size <= WRITTEN:
                panel.text(col, row, f"{100 * share:.0f}", ha="center", va="center", color=ink)
        best = advice.best(name).candidate
        corner = slips.index(best.slip) - 0.5, loads.index(best.load) - 0.5
        frame = Rectangle(corner, 1, 1, fill=False, edgecolor="#d62728", linewidth=2.5)
        panel.add_patch(frame)
        if driven is not None:
            slip = np.interp(np.atleast_1d(driven.slip), slips, np.arange(len(slips)))
            load = np.interp(np.atleast_1d(driven.load), loads, np.arange(len(loads)))
            panel.plot(slip, load, "o", color="#d62728", fillstyle="none", markersize=25, mew=2)
        across, up = (range(0, n, -(-n // TICKS)) for n in (len(slips), len(loads)))
        panel.set_xticks(across, [f"{slips[k]:.3g}" for k in across])
        panel.set_yticks(up, [f"{loads[k]:.3g}" for k in up])
        panel.set_title(f"{name.replace('_', ' ')}: now {advice.now[i]:.0%}")
    axes[0, 0].set_ylabel("load of the next row, N")
    figure.supxlabel("slip of the next row (frame: best, rings: driven)", fontsize=10)
    figure.colorbar(image, ax=axes[0], label="expected width left of the prior")
    with atomic_output(path) as part:
        figure.savefig(part, format="png", dpi=110)
    pyplot.close(figure)
