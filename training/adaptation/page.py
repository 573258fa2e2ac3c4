"""The result of an adaptation as a page, a picture and text for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.io.text_tables import format_table
from soilml.parameters import declared
from soilml.physics.soils import Soil
from soilml.quantities import Z_90
from soilml.report.figure_style import AFTER, BEFORE, picture, take_axes
from soilml.report.numbers import (
    channel_name,
    channel_unit,
    format_number,
    format_quantity,
    parameter_name,
    with_unit,
)
from soilml.report.page import Report, ReportPicture, ReportTable
from training.adaptation.judgement import JudgedRun, Judgement, RunPrediction
from training.adaptation.result import AdaptReport

#: Colour of the verdict, and its badge, by status.
TONES = {
    "adapted": ("named", "adapted"),
    "not-better": ("suspected", "old file stays"),
    "not-judged": ("suspected", "not judged"),
    "not-supported": ("no-gap", "old file stays"),
}
MOST_RUNS = 4  # Most runs in the picture
MARKERS = ("o", "s", "^", "D")
COLUMNS, PANEL = 2, (4.4, 3.6)  # Panels side by side, and width and height of each, inches


def adapt_page(report: AdaptReport) -> Report:
    """The page of a result."""
    tone, badge = TONES[report.status]
    judgement = report.judgement
    answer = [report.sentence]
    if judgement is None:
        trained = report.status == "not-judged"
        meaning = "no run was kept back" if trained else "no file was trained"
        answer += [report.gap_sentence] if trained else []
        pictures: Sequence[ReportPicture] = ()
        tables: Sequence[ReportTable] = ()
    else:
        answer.append(report.gap_sentence)
        meaning = f"judged on {_runs(report.kept_back)}, which neither file was made from"
        pictures, tables = [judgement_picture(judgement)], judgement_tables(judgement)
    return Report(
        kind="adapt",
        title="A file for the board, adapted to a campaign",
        badge=badge,
        meaning=meaning,
        answer=answer,
        tone=tone,
        pictures=pictures,
        tables=tables,
        warnings=report.remarks,
        next_steps=next_steps(report),
        notation=[
            ("error", "root mean square of measured − predicted, over the channel's range"),
            ("log score", "mean logarithm of the predictive density of a reading, in ranges"),
        ],
    )


def next_steps(report: AdaptReport) -> list[str]:
    """What to do with the result."""
    if report.status == "not-judged":
        return [f"measure the runs of gap/next_runs.csv before {report.files[0]} flies"]
    if report.status == "adapted":
        return [f"put {report.files[0]} on the board, or compile {report.files[2]}"]
    if any(remark.code == "prior-opened" for remark in report.remarks):
        return ["change the priors in [soil.prior] of the model file, and run this again"]
    if report.gap_status == "suspected" and report.judgement is None:
        return ["see gap/report.html; --suspected tries the first suspect all the same"]
    if report.gap_status == "no-gap":
        return []
    return ["see gap/report.html, and measure the runs of gap/next_runs.csv"]


def adapt_text(report: AdaptReport) -> str:
    """The verdict and its tables, for the terminal."""
    parts = [report.sentence]
    if report.status != "not-supported":
        parts.append(f"{report.gap_status}: {report.gap_sentence}")
    if report.judgement is not None:
        parts.append(f"judged on {_runs(report.kept_back)}")
        for table in judgement_tables(report.judgement):
            parts.append(format_table(table.header, table.rows, text_columns=table.text_columns))
    parts += [f"! {remark}" for remark in report.remarks]
    steps = next_steps(report)
    return "\n\n".join([*parts, *(f"next: {step}" for step in steps)])


def judgement_tables(judgement: Judgement) -> list[ReportTable]:
    """Errors and log scores by channel and number of first rows; errors of a known soil."""
    rows = []
    for k in judgement.lengths:
        for key, (before, after) in judgement.figures(k).items():
            rows.append(
                (
                    channel_name(key),
                    f"{k}",
                    _percent(before.error),
                    _percent(after.error),
                    format_number(before.log_score),
                    format_number(after.log_score),
                )
            )
    header = ("predicted", "first rows", "error before", "after", "log score before", "after")
    tables = [ReportTable("Later rows, predicted from the first", header, rows)]
    if judgement.soil_error:
        units = {name: parameter.unit for name, parameter in declared(Soil).items()}
        own = [
            (parameter_name(name), format_quantity(b, units[name]), format_quantity(a, units[name]))
            for name, (b, a) in judgement.soil_error.items()
        ]
        columns = ("soil", "error before", "after")
        tables.append(ReportTable("Estimates against the known soil", columns, own))
    return tables


def judgement_picture(judgement: Judgement) -> ReportPicture:
    """A panel for each channel, and one of the errors."""
    lines, k = panel_rows(judgement), _shown_rows(judgement)
    before, after = judgement.error()
    alt = (
        f"{', '.join(map(channel_name, judgement.channels))} over slip, measured and predicted by "
        f"both files; errors of {_percent(before)} before and {_percent(after)} after"
    )
    size = (PANEL[0] * COLUMNS, PANEL[1] * lines)
    caption = (
        f"The soil was estimated from the torque of the first {k} rows of a run. Points: the later "
        "rows as measured. Lines: as predicted by the old file (orange, dashed) and by the adapted "
        "one (blue, with its 90 % band)."
    )
    image = picture(partial(draw_judgement, judgement), lines, COLUMNS, size, alt)
    return ReportPicture("Runs kept back", image, caption)


def panel_rows(judgement: Judgement) -> int:
    """Rows of panels of the picture."""
    return -(-(len(judgement.channels) + 1) // COLUMNS)


def _shown_rows(judgement: Judgement) -> int:
    """The number of first rows for which predictions are drawn: the largest."""
    return judgement.lengths[-1]


def plot_judgement(judgement: Judgement, ax: Any = None) -> NDArray[Any]:
    """Draw the picture into the axes of `take_axes`; a new figure where None."""
    lines = panel_rows(judgement)
    axes = take_axes(ax, lines, COLUMNS, (PANEL[0] * COLUMNS, PANEL[1] * lines))
    draw_judgement(judgement, axes)
    return axes


def draw_judgement(judgement: Judgement, axes: Any) -> None:
    """Draw a panel for each channel, then that of the errors; further axes are switched off."""
    k = _shown_rows(judgement)
    runs = [run for run in judgement.runs if run.first_rows == k][:MOST_RUNS]
    panels = list(np.asarray(axes).flat)
    for panel, key in zip(panels, judgement.channels, strict=False):
        _draw_channel(panel, key, runs)
    count = len(judgement.channels)
    _draw_errors(panels[count], judgement)
    for panel in panels[count + 1 :]:
        panel.set_axis_off()


def _draw_channel(axes: Any, key: str, runs: Sequence[JudgedRun]) -> None:
    """Readings of the later rows, and both predictions, over slip."""
    factor, unit = channel_unit(key)
    for marker, run in zip(MARKERS, runs, strict=False):
        order = np.argsort(run.rows["slip"], kind="stable")
        slip = run.rows["slip"][order]
        load = float(np.median(run.rows["load_N"]))
        after = factor * run.after.mean[key][order]
        band = Z_90 * factor * run.after.std[key][order]
        axes.fill_between(slip, after - band, after + band, color=AFTER, alpha=0.15, lw=0)
        axes.plot(slip, _line(run.before, key, factor, order), "--", color=BEFORE, lw=1.6)
        axes.plot(slip, after, "-", color=AFTER, lw=1.6)
        axes.plot(
            slip, factor * run.rows[key][order], marker, color="black", ms=4.2, ls="none",
            label=f"{run.run}, {format_number(load)} N",
        )  # fmt: skip
    name = channel_name(key)
    axes.set_title(with_unit(name, f"({unit})") if unit else name)
    axes.set_xlabel("slip")
    axes.grid(color="#e4e4e4", lw=0.7)
    axes.set_axisbelow(True)
    axes.legend(fontsize=8.5, frameon=False)


def _line(prediction: RunPrediction, key: str, factor: float, order: Any) -> Any:
    return factor * prediction.mean[key][order]


def _draw_errors(axes: Any, judgement: Judgement) -> None:
    """Bars of the error before and after, for each number of first rows."""
    labels, most = [], 0.0
    for i, k in enumerate(judgement.lengths):
        labels.append(f"first {k} rows")
        for side, error in enumerate(judgement.error(k)):
            colour, label = ((BEFORE, "old file"), (AFTER, "adapted file"))[side]
            y, most = i + 0.36 * side - 0.18, max(most, error)
            axes.barh(y, 100.0 * error, 0.3, color=colour, label=None if i else label)
            axes.annotate(
                _percent(error), (100.0 * error, y), xytext=(5, 0), textcoords="offset points",
                va="center",
            )  # fmt: skip
    axes.set_yticks(range(len(labels)), labels)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_xlim(0.0, 125.0 * most)
    axes.set_xlabel("% of the channels' ranges")
    axes.set_title("error of the later rows")
    axes.legend(fontsize=8.5, frameon=False, loc="lower right")


def _percent(share: float) -> str:
    return f"{format_number(100.0 * share, 2)} %"


def _runs(names: Sequence[str]) -> str:
    return f"run{'s' if len(names) > 1 else ''} {', '.join(names)}"
