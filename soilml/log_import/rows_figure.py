"""The rows of an import over slip, with 90 % intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.io.table import Table
from soilml.log_import.recording import Floats
from soilml.quantities import Z_90
from soilml.report.figure_style import take_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Colours of loads, from light to heavy.
_LOADS = ("#0d0887", "#9c179e", "#cc4778", "#e0603f", "#d98300")


def plot_rows(table: Table, radius: float, ax: Any = None) -> NDArray[Any]:
    """Draw the rows over slip, a panel for each channel that was measured; see `take_axes`."""
    shown = panels_over_slip(table, radius)
    panels = take_axes(ax, 1, len(shown), (5.0 * len(shown), 3.6))[0]
    for axes, panel in zip(panels, shown, strict=True):
        draw_over_slip(axes, table, panel)
    return np.asarray(panels)


@dataclass(frozen=True)
class PanelOverSlip:
    """A column to show over slip, what it is divided by (rows,), and the title."""

    key: str
    unit: Floats
    title: str


def panels_over_slip(table: Table, radius: float) -> list[PanelOverSlip]:
    """T / (W r), or torque where the radius (m) is NaN; drawbar pull over load; sinkage."""
    load, found = table["load_N"], []
    if np.isfinite(table["torque_Nm"]).any():
        if np.isfinite(radius):
            found.append(PanelOverSlip("torque_Nm", load * radius, "torque / (load × radius)"))
        else:
            found.append(PanelOverSlip("torque_Nm", np.ones(len(table)), "torque, N m"))
    if "drawbar_pull_N" in table:
        found.append(PanelOverSlip("drawbar_pull_N", load, "drawbar pull / load"))
    if "sinkage_m" in table:
        found.append(PanelOverSlip("sinkage_m", np.full(len(table), 1e-3), "sinkage, mm"))
    return found


def draw_over_slip(axes: Axes, table: Table, panel: PanelOverSlip) -> None:
    """Draw a column over slip with 90 % intervals, in a colour for each load."""
    key, unit = panel.key, panel.unit
    loads = table["load_N"]
    groups = load_groups(loads)
    std = table[f"{key}_std"] if f"{key}_std" in table else np.zeros(len(table))
    slip_std = table["slip_std"] if "slip_std" in table else np.zeros(len(table))
    for k in range(int(groups.max()) + 1):
        rows = groups == k
        colour = _LOADS[round(k * (len(_LOADS) - 1) / max(1, groups.max()))]
        axes.errorbar(
            table["slip"][rows], (table[key] / unit)[rows],
            Z_90 * np.nan_to_num(std / unit)[rows], Z_90 * np.nan_to_num(slip_std)[rows],
            fmt="o", ms=4, color=colour, elinewidth=1, label=f"{np.median(loads[rows]):.3g} N",
        )  # fmt: skip
    axes.axhline(0.0, color="#999999", lw=0.8, zorder=0)
    axes.set_xlabel("slip")
    axes.set_title(panel.title)
    axes.legend(fontsize=9, frameon=False, title="load", title_fontsize=9)


def load_groups(loads: Floats) -> NDArray[np.int64]:
    """Group (rows,) of each load: gaps of more than 10 % divide them, into at most five."""
    order = np.argsort(loads)
    gaps = np.diff(np.log(loads[order]))
    edges = np.sort(np.argsort(-gaps)[: len(_LOADS) - 1])
    edges = edges[gaps[edges] > 0.1]
    groups = np.zeros(loads.size, dtype=np.int64)
    groups[order] = np.searchsorted(edges, np.arange(loads.size), side="left")
    return groups
