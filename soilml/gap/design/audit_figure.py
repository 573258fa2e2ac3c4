"""What a design sees of each effect, and how well it separates it, as bars."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from soilml.gap.design.effect_identifiability import NAMEABLE_SIGMA
from soilml.report.figure_style import AFTER, UNCHANGED, take_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from soilml.gap.design.identifiability_audit import Audit


def plot_audit(found: Audit, ax: Any) -> Axes:
    """Draw the bars into axes; see `Audit.plot`."""
    effects = found.effects
    axes: Axes = take_axes(ax, 1, 1, (5.6, 1.0 + 0.34 * max(len(effects), 1)))[0, 0]
    y = np.arange(len(effects))
    left = [e.residual_signal for e in effects]
    apart = [e.separating_snr for e in effects]
    axes.barh(y - 0.19, left, 0.36, color=UNCHANGED, label="that the soil cannot imitate")
    axes.barh(y + 0.19, apart, 0.36, color=AFTER, label="that tells it from its nearest rival")
    axes.axvline(NAMEABLE_SIGMA, color="black", lw=1.2)
    axes.set_xscale("symlog", linthresh=1.0)
    axes.set_xlim(left=0.0)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_yticks(y, [e.name for e in effects])
    axes.set_ylim(len(effects) - 0.5, -0.5)
    axes.set_xlabel(f"signal at the reference size (σ); line: {NAMEABLE_SIGMA:g} σ name an effect")
    if effects:
        axes.legend(fontsize=8, loc="lower right")  # the best separated stand above
    return axes
