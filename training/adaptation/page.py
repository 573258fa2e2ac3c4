"""What an adaptation says: the verdict on both files, and the picture of the judgement."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from soilml.parameters import declared
from soilml.physics.soils import Soil
from soilml.quantities import Z_90
from soilml.report.figure_style import AFTER, BEFORE
from soilml.report.numbers import (
    channel_name,
    channel_unit,
    format_quantity,
    parameter_name,
    pretty,
    significant,
    with_unit,
)
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from training.adaptation.judgement import JudgedRun, Judgement
from training.adaptation.result import AdaptReport

#: Tone of the verdict, and its status in words, by status.
TONES = {
    "adapted": ("good", "adapted"),
    "not-better": ("warn", "old file stays"),
    "not-judged": ("warn", "not judged"),
    "not-supported": ("plain", "old file stays"),
}
MOST_RUNS = 4  # Most runs in the picture
MARKERS = ("o", "s", "^", "D")
COLUMNS, PANEL = 2, (4.4, 3.6)  # Panels side by side, and width and height of each, inches


def report_of_adaptation(found: AdaptReport) -> Report:
    """The report of a result."""
    tone, status = TONES[found.status]
    judged = found.judgement
    trained = found.status != "not-supported"
    basis = "no run was kept back" if trained else "no file was trained"
    if judged is not None:
        runs = f"run{'s' if len(found.kept_back) > 1 else ''} {', '.join(found.kept_back)}"
        basis = f"judged on {runs}, which neither file was made from"
    return Report(
        kind="adapt",
        verdict=found.sentence,
        lines=[f"{found.gap_status}: {found.gap_sentence}"] if trained else [],
        tables=[] if judged is None else _tables(found, judged),
        pictures=[] if judged is None else [_picture(judged)],
        remarks=found.remarks,
        next_steps=next_steps(found),
        status=status,
        tone=tone,
        title="A file for the board, adapted to a campaign",
        basis=basis,
        notation=[
            ("error", "root mean square of measured - predicted, over the channel's range"),
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


def _tables(found: AdaptReport, judged: Judgement) -> list[ReportTable]:
    """Errors and log scores by channel and number of first rows; errors of a known soil."""
    own = found.frame_columns()
    tables = [
        ReportTable(
            "Later rows, predicted from the first",
            [
                Column("predicted", [channel_name(key) for key in own["predicted"]]),
                Column("first rows", own["first_rows"]),
                Column("error before", own["error_before"], "share", digits=2),
                Column("error after", own["error_after"], "share", digits=2),
                Column("log score before", own["log_score_before"], digits=3),
                Column("after", own["log_score_after"], digits=3),
            ],
        )
    ]
    if judged.soil_error:
        units = [declared(Soil)[name].unit for name in judged.soil_error]
        before, after = ([pair[k] for pair in judged.soil_error.values()] for k in (0, 1))
        columns = [
            Column("soil", [parameter_name(name) for name in judged.soil_error]),
            Column("error before", before, units, digits=3),
            Column("after", after, units, digits=3, sizes=before),
        ]
        tables.append(ReportTable("Estimates against the known soil", columns))
    return tables


def _picture(judged: Judgement) -> Picture:
    """A panel for each channel, and one of the errors."""
    lines, k = -(-(len(judged.channels) + 1) // COLUMNS), judged.lengths[-1]
    before, after = (format_quantity(x, "share", digits=2) for x in judged.error())
    return Picture(
        "Runs kept back",
        partial(_draw, judged),
        lines,
        COLUMNS,
        (PANEL[0] * COLUMNS, PANEL[1] * lines),
        f"{', '.join(map(channel_name, judged.channels))} over slip, measured and predicted by "
        f"both files; errors of {before} before and {after} after",
        f"The soil was estimated from the torque of the first {k} rows of a run. Points: the later "
        "rows as measured. Lines: as predicted by the old file (orange, dashed) and by the adapted "
        "one (blue, with its 90 % band).",
    )


def _draw(judged: Judgement, axes: Any) -> None:
    runs = [run for run in judged.runs if run.first_rows == judged.lengths[-1]][:MOST_RUNS]
    panels = list(np.asarray(axes).flat)
    for panel, key in zip(panels, judged.channels, strict=False):
        _draw_channel(panel, key, runs)
    count = len(judged.channels)
    _draw_errors(panels[count], judged)
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
        axes.plot(slip, factor * run.before.mean[key][order], "--", color=BEFORE, lw=1.6)
        axes.plot(slip, after, "-", color=AFTER, lw=1.6)
        axes.plot(
            slip, factor * run.rows[key][order], marker, color="black", ms=4.2, ls="none",
            label=f"{run.run}, {significant(load, 3)} N",
        )  # fmt: skip
    name = channel_name(key)
    axes.set_title(pretty(with_unit(name, unit)))
    axes.set_xlabel("slip")
    axes.legend()


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
                format_quantity(error, "share", digits=2), (100.0 * error, y), xytext=(5, 0),
                textcoords="offset points", va="center",
            )  # fmt: skip
    axes.set_yticks(range(len(labels)), labels)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_xlim(0.0, 125.0 * most)
    axes.set_xlabel("% of the channels' ranges")
    axes.set_title("error of the later rows")
    axes.legend(loc="lower right")
