"""The result of an adaptation: verdict, the gap that it rests on, the judgement of both files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from soilml.errors import InputError
from soilml.quantities import Z_90
from soilml.remarks import Remark
from soilml.report.figure_style import AFTER, BEFORE
from soilml.report.numbers import (
    channel_name,
    channel_unit,
    decimal,
    format_quantity,
    pretty,
    significant,
    with_unit,
)
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from soilml.results import Result
from training.adaptation.judgement import JudgedRun, Judgement

#: Tone of the verdict, and its status in words, by status: the adapted file predicts runs that were
#: kept back better than the old one; it was trained, and the old one predicts them no worse; it was
#: trained, and the campaign has too few runs to judge it; the gap analysis supports no change.
TONES = {
    "adapted": ("good", "adapted"),
    "not-better": ("warn", "old file stays"),
    "not-judged": ("warn", "not judged"),
    "not-supported": ("plain", "old file stays"),
}
MARKERS = ("o", "s", "^", "D")  # Of the runs in the picture
MOST_RUNS, PANEL = len(MARKERS), (4.4, 3.6)  # Width and height of a panel, inches


@dataclass(frozen=True, repr=False)
class AdaptReport(Result):
    """The result of `adapt`.

    Attributes
    ----------
    status : str
        One of `TONES`; with `not-better` and `not-supported` the old file stays.
    gap_status, gap_sentence : str
        Verdict of the gap analysis of the campaign.
    effects : tuple of str
        Effects that were added to the model.
    kept_back : tuple of str
        The runs on which both files were judged.
    judgement : Judgement or None
        None where the analysis does not support a change, and where no run was kept back.
    files : tuple of str
        The files of the folder, the adapted model file first.
    remarks : tuple of Remark
        Limits and what to do next.
    rows, seed : int
        Synthetic rows that each file was trained on, and the seed of everything drawn.
    """

    status: str
    gap_status: str
    gap_sentence: str
    effects: tuple[str, ...]
    kept_back: tuple[str, ...]
    judgement: Judgement | None
    files: tuple[str, ...]
    remarks: tuple[Remark, ...]
    rows: int
    seed: int

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        if self.status == "not-judged":
            return f"A file was trained and not judged, with {' + '.join(self.effects)}."
        if self.judgement is None:
            return f"The old file stays: {self.gap_sentence}"
        ratio = decimal(self.judgement.ratio, 2)
        if self.status == "adapted":
            return (
                f"The adapted file predicts kept-back runs with {ratio} of the error of the old "
                "one."
            )
        return (
            f"The old file stays: the adapted one predicts kept-back runs with {ratio} times its "
            "error."
        )

    def report(self) -> Report:
        """Whether the file is better, by how much, and what to do."""
        judged = self.judgement
        trained = self.status != "not-supported"
        basis = "no run was kept back" if trained else "no file was trained"
        if judged is not None:
            runs = f"run{'s' if len(self.kept_back) > 1 else ''} {', '.join(self.kept_back)}"
            basis = f"judged on {runs}, which neither file was made from"
        tone, status = TONES[self.status]
        return Report(
            kind="adapt",
            verdict=self.sentence,
            lines=[f"{self.gap_status}: {self.gap_sentence}"] if trained else [],
            tables=[] if judged is None else [_table(self)],
            pictures=[] if judged is None else [_picture(judged)],
            remarks=self.remarks,
            next_steps=self._next_steps(),
            status=status,
            tone=tone,
            title="A file for the board, adapted to a campaign",
            basis=basis,
            notation=[
                ("error", "root mean square of measured - predicted, over the channel's range"),
                ("log score", "mean logarithm of the predictive density of a reading, in ranges"),
            ],
        )

    def _next_steps(self) -> list[str]:
        if self.status == "not-judged":
            return [f"measure the runs of gap/next_runs.csv before {self.files[0]} flies"]
        if self.status == "adapted":
            return [f"put {self.files[0]} on the board, or compile {self.files[2]}"]
        if any(remark.code == "prior-opened" for remark in self.remarks):
            return ["change the priors in [soil.prior] of the model file, and run this again"]
        if self.gap_status == "suspected" and self.judgement is None:
            return ["see gap/report.html; --suspected tries the first suspect all the same"]
        if self.gap_status == "no-gap":
            return []
        return ["see gap/report.html, and measure the runs of gap/next_runs.csv"]

    def frame_columns(self) -> dict[str, Any]:
        """A row for each channel: errors and log scores of both files.

        Raises `InputError` where no file was judged.
        """
        if self.judgement is None:
            raise InputError("no file was judged, so that there are no figures")
        figures = self.judgement.figures()
        pairs = list(figures.values())
        return {
            "predicted": list(figures),
            "error_before": [before.error for before, _ in pairs],
            "error_after": [after.error for _, after in pairs],
            "log_score_before": [before.log_score for before, _ in pairs],
            "log_score_after": [after.log_score for _, after in pairs],
        }

    def as_json(self) -> dict[str, Any]:
        """The content of adapt.json; soil in SI units, errors over the range of a channel."""
        content: dict[str, Any] = {
            "status": self.status,
            "sentence": self.sentence,
            "gap": {"status": self.gap_status, "sentence": self.gap_sentence},
            "effects": list(self.effects),
            "kept_back": list(self.kept_back),
            "files": list(self.files),
            "rows": self.rows,
            "seed": self.seed,
            "remarks": [remark.as_json() for remark in self.remarks],
        }
        if self.judgement is not None:
            channels = {
                key: {"before": vars(old), "after": vars(new)}
                for key, (old, new) in self.judgement.figures().items()
            }
            content["judgement"] = {
                "error_ratio": self.judgement.ratio,
                "error": dict(zip(("before", "after"), self.judgement.error(), strict=True)),
                "channels": channels,
            }
        return content


def _table(found: AdaptReport) -> ReportTable:
    """Errors and log scores by channel."""
    own = found.frame_columns()
    return ReportTable(
        "Later rows, predicted from the first",
        [
            Column("predicted", [channel_name(key) for key in own["predicted"]]),
            Column("error before", own["error_before"], "share", digits=2),
            Column("error after", own["error_after"], "share", digits=2),
            Column("log score before", own["log_score_before"], digits=3),
            Column("after", own["log_score_after"], digits=3),
        ],
    )


def _picture(judged: Judgement) -> Picture:
    """A panel for each channel."""
    count, k = len(judged.channels), max(run.first_rows for run in judged.runs)
    before, after = (format_quantity(x, "share", digits=2) for x in judged.error())
    return Picture(
        "Runs kept back",
        partial(_draw, judged),
        1,
        count,
        (PANEL[0] * count, PANEL[1]),
        f"{', '.join(map(channel_name, judged.channels))} over slip, measured and predicted by "
        f"both files; errors of {before} before and {after} after",
        f"The soil was estimated from the torque of the first rows of a run, {k} at most. Points: "
        "the later rows as measured. Lines: as predicted by the old file (orange, dashed) and by "
        "the adapted one (blue, with its 90 % band).",
    )


def _draw(judged: Judgement, axes: Any) -> None:
    for panel, key in zip(np.asarray(axes).flat, judged.channels, strict=True):
        _draw_channel(panel, key, judged.runs[:MOST_RUNS])


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
