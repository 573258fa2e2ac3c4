"""An advice as remarks, as JSON, and as maps over slip and load."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.experiment_design.design import Advice, RatedRow
from soilml.physics.operating_point import Operating
from soilml.quantities import NOT_IDENTIFIED_ABOVE, column
from soilml.remarks import NEXT_ROW, Remark
from soilml.report.numbers import parameter_name, share_left
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable

#: Differences of remaining fractions that are not reported: the sampling error of one call.
NEGLIGIBLE = 0.02
#: Most grid points that are labelled with their value, and most ticks of an axis.
MOST_LABELS, TICKS = 80, 8


def is_identified(remaining_fraction: Floats) -> NDArray[np.bool_]:
    """Whether the remaining fraction of a prior is at most `NOT_IDENTIFIED_ABOVE`."""
    return np.asarray(remaining_fraction <= NOT_IDENTIFIED_ABOVE)


def next_row_remarks(advice: Advice) -> list[Remark]:
    """A remark on each parameter that is not identified, and one on the best row for all."""
    remarks = []
    for name, fraction in zip(advice.names, advice.current_fraction.tolist(), strict=True):
        if fraction > NOT_IDENTIFIED_ABOVE:
            text = (
                f"{name.replace('_', ' ')}: not identified by these rows, {share_left(fraction)} "
                f"the prior's width remains. {_most_informative(advice, name)}"
            )
            remarks.append(Remark(NEXT_ROW, text, (name,), "note"))
    best = f"best next row for all parameters: {row_message(advice, advice.best())}"
    return [*remarks, Remark(NEXT_ROW, best, advice.names, "note")]


def row_message(advice: Advice, choice: RatedRow) -> str:
    """A row, and the fraction of each prior expected to remain after it."""
    pairs = zip(advice.names, choice.remaining_fraction, strict=True)
    fractions = ", ".join(f"{name.replace('_', ' ')} {fraction:.0%}" for name, fraction in pairs)
    return f"{choice.candidate.description} (expected to leave {fractions})"


def _most_informative(advice: Advice, name: str) -> str:
    """The best row for one parameter, compared with repeating measured points."""
    i = advice.names.index(name)
    best = advice.best(name)
    fraction = float(best.remaining_fraction[i])
    rows = ", then ".join(c.candidate.description for c in advice.sequence)
    several = f"{len(advice.sequence)} rows leave "
    several += f"{advice.sequence[-1].remaining_fraction[i]:.0%}: {rows}"
    if len(advice.sequence) < 2:
        several = "several rows at other slips and loads may"
    if fraction > advice.current_fraction[i] - NEGLIGIBLE:
        return f"No single row identifies it: {several}"
    text = f"Most informative next: {best.candidate.description} (leaves {fraction:.0%})"
    others = {c: float(advice.best(name, c).remaining_fraction[i]) for c in advice.channel_sets[1:]}
    if others and (other := min(others.values())) < fraction - NEGLIGIBLE:
        channels = min(others, key=lambda c: others[c])
        text += f", with {channels[1].replace('_', ' ')} {other:.0%}"
    if (repetition := advice.best_repetition(name)) is not None:
        text += f"; a repetition leaves {repetition.remaining_fraction[i]:.0%}"
    return text if fraction <= NOT_IDENTIFIED_ABOVE else f"{text}; {several}"


def _row_as_json(advice: Advice, choice: RatedRow) -> dict[str, object]:
    """A row, and the fraction of each prior expected to remain after it."""
    row, left = choice.candidate, choice.remaining_fraction.tolist()
    fractions = dict(zip(advice.names, left, strict=True))
    return {"slip": row.slip, "load_N": row.load, "channels": list(row.channels)} | {
        "remaining_fraction": fractions
    }


def advice_as_json(advice: Advice) -> dict[str, object]:
    """Which parameters are identified, and the best next rows: for all, for each, repeated."""
    repetition = advice.best_repetition()
    identified = is_identified(advice.current_fraction).tolist()
    return {
        "identified": dict(zip(advice.names, identified, strict=True)),
        "advice": {
            "next": _row_as_json(advice, advice.best()),
            "next_for": {name: _row_as_json(advice, advice.best(name)) for name in advice.names},
            "repeat": None if repetition is None else _row_as_json(advice, repetition),
        },
    }


def _draw_maps(advice: Advice, measured: Operating | None, axes: Any) -> None:
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
        if measured is not None:
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


def report_of_advice(
    advice: Advice, measured: Operating | None = None, remarks: Sequence[Remark] = ()
) -> Report:
    """The report of an advice; `measured` are the operating points of earlier rows."""
    rows, columns = best_rows(advice), []
    for name, values in advice_columns(advice, rows).items():
        if name.endswith("_left"):
            symbol = parameter_name(name.removesuffix("_left")).split()[-1]
            columns.append(Column(f"{symbol} left", values.tolist(), "share", digits=2))
        elif name != "channels":
            unit = "N" if name == "load_N" else "1"
            columns.append(Column(name.removesuffix("_N"), list(values), unit, digits=3))
    verdict, count = f"Measure next: {row_message(advice, advice.best())}.", len(advice.names)
    vague = advice.names if measured is None else [
        n for n, ok in zip(advice.names, is_identified(advice.current_fraction), strict=True)
        if not ok
    ]  # fmt: skip
    return Report(
        kind="plan",
        verdict=verdict,
        tables=[ReportTable("Rows to measure next", columns, "Width that is left of each prior.")],
        pictures=[
            Picture(
                "Next rows", partial(_draw_maps, advice, measured), 1, count, (3.8 * count, 3.6),
                verdict,
                "Expected width, in percent of the prior's, after a row at this slip and load. "
                "Frame: the best row. Rings: measured rows. Blank: the soil might not carry it.",
            )
        ],
        remarks=remarks,
        status=f"{len(vague)} of {count} open" if vague else "identified",
        title="Measurement to make next",
    )  # fmt: skip


def best_rows(advice: Advice) -> list[tuple[str, RatedRow]]:
    """The rows of the table: reason and candidate."""
    rows = [("best in all", advice.best())]
    rows += [
        (f"best in all with {own[1]}", advice.best(None, own)) for own in advice.channel_sets[1:]
    ]
    rows += [(f"best for {name}", advice.best(name)) for name in advice.names]
    repeat = advice.best_repetition()
    if repeat is not None:
        rows.append(("best repeat", repeat))
    if len(advice.sequence) > 1:
        rows += [
            (f"row {i} of {len(advice.sequence)}", c) for i, c in enumerate(advice.sequence, 1)
        ]
    return rows


def advice_columns(advice: Advice, rows: Sequence[tuple[str, RatedRow]]) -> dict[str, Any]:
    """The table's columns."""
    choices = [choice for _, choice in rows]
    columns: dict[str, Any] = {
        "row": [why.replace("_", " ") for why, _ in rows],
        "channels": [" + ".join(map(column, c.candidate.channels)) for c in choices],
        "slip": np.asarray([c.candidate.slip for c in choices]),
        "load_N": np.asarray([c.candidate.load for c in choices]),
    }
    for i, name in enumerate(advice.names):
        columns[f"{name}_left"] = np.asarray([c.remaining_fraction[i] for c in choices])
    columns["all_left"] = np.asarray([c.overall for c in choices])
    return columns
