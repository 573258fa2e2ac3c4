"""An advice as a report, with maps over slip and load."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from soilml.experiment_design.design import Advice, RatedRow
from soilml.quantities import NOT_IDENTIFIED_ABOVE
from soilml.report.numbers import parameter_name, share_left
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable

#: Most grid points that are labelled with their value, and most ticks of an axis.
MOST_LABELS, TICKS = 80, 8


def report_of_advice(advice: Advice) -> Report:
    """The report of an advice."""
    columns = []
    for name, values in advice.best_columns().items():
        if name.endswith("_left"):
            symbol = parameter_name(name.removesuffix("_left")).split()[-1]
            columns.append(Column(f"{symbol} left", values.tolist(), "share", digits=2))
        elif name != "channels":
            unit = "N" if name == "load_N" else "1"
            columns.append(Column(name.removesuffix("_N"), list(values), unit, digits=3))
    verdict, count = f"Measure next: {_row_text(advice, advice.best())}.", len(advice.names)
    vague = _vague(advice)
    return Report(
        kind="plan",
        verdict=verdict,
        lines=[] if advice.measured is None else list(_lines(advice)),
        tables=[ReportTable("Rows to measure next", columns, "Width that is left of each prior.")],
        pictures=[
            Picture(
                "Next rows", partial(_draw_maps, advice), 1, count, (3.8 * count, 3.6), verdict,
                "Expected width, in percent of the prior's, after a row at this slip and load. "
                "Frame: the best row. Rings: measured rows. Blank: the soil might not carry it.",
            )
        ],
        remarks=advice.remarks,
        status=f"{len(vague)} of {count} open" if vague else "identified",
        title="Measurement to make next",
    )  # fmt: skip


def _vague(advice: Advice) -> list[str]:
    """The parameters that the rows do not identify."""
    shares = zip(advice.names, advice.current_fraction, strict=True)
    return [name for name, share in shares if share > NOT_IDENTIFIED_ABOVE]


def _row_text(advice: Advice, choice: RatedRow) -> str:
    """A row, and the fraction of each prior expected to remain after it."""
    pairs = zip(advice.names, choice.remaining_fraction, strict=True)
    fractions = ", ".join(f"{name.replace('_', ' ')} {fraction:.0%}" for name, fraction in pairs)
    return f"{choice.candidate.description} (expected to leave {fractions})"


def _lines(advice: Advice) -> Iterator[str]:
    """What is left of a parameter that is not identified, now and after the best rows for it."""
    for name in _vague(advice):
        i = advice.names.index(name)
        now = float(advice.current_fraction[i])
        text = f"These rows leave {share_left(now)} the prior's width of {name.replace('_', ' ')}"
        text += f"; the best row for it leaves {advice.best(name).remaining_fraction[i]:.0%}"
        if (repetition := advice.best_repetition(name)) is not None:
            text += f", a repetition {repetition.remaining_fraction[i]:.0%}"
        if (count := len(advice.sequence)) > 1:
            text += f", the {count} planned rows {advice.sequence[-1].remaining_fraction[i]:.0%}"
        yield f"{text}."


def _draw_maps(advice: Advice, axes: Any) -> None:
    """Draw a map for each parameter into axes (1, parameters)."""
    from matplotlib.patches import Rectangle

    choices = advice.with_channels(advice.channel_sets[0])
    slips = sorted({c.candidate.slip for c in choices})
    loads = sorted({c.candidate.load for c in choices})
    for i, (name, panel) in enumerate(zip(advice.names, np.ravel(axes), strict=True)):
        fraction = np.full((len(loads), len(slips)), np.nan)
        for c in choices:
            cell = loads.index(c.candidate.load), slips.index(c.candidate.slip)
            fraction[cell] = c.remaining_fraction[i]
        panel.pcolormesh(fraction, cmap="viridis", vmin=0.0, vmax=1.0)
        for (row, col), share in np.ndenumerate(fraction):
            ink = "#010101" if share > 0.6 else "#fdfdfd"
            if np.isfinite(share) and fraction.size <= MOST_LABELS:
                text = f"{100 * share:.0f}"
                panel.text(col + 0.5, row + 0.5, text, ha="center", va="center", color=ink)
        best = advice.best(name).candidate
        corner = slips.index(best.slip), loads.index(best.load)
        panel.add_patch(Rectangle(corner, 1, 1, fill=False, edgecolor="#d62728", linewidth=2.5))
        if (measured := advice.measured) is not None:
            slip = np.interp(np.atleast_1d(measured.slip), slips, np.arange(len(slips)) + 0.5)
            load = np.interp(np.atleast_1d(measured.load), loads, np.arange(len(loads)) + 0.5)
            panel.plot(slip, load, "o", color="#d62728", fillstyle="none", markersize=18, mew=2)
        across, up = (range(0, n, -(-n // TICKS)) for n in (len(slips), len(loads)))
        panel.set_xticks([k + 0.5 for k in across], [f"{slips[k]:.3g}" for k in across])
        panel.set_yticks([k + 0.5 for k in up], [f"{loads[k]:.3g}" for k in up])
        panel.grid(visible=False)
        panel.set_title(f"{name.replace('_', ' ')}: now {advice.current_fraction[i]:.0%}")
        panel.set_xlabel("slip of the next row")
        panel.set_ylabel("load of the next row, N")
