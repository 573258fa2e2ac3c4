"""The result of an adaptation: verdict, the gap that it rests on, the judgement of both files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from soilml.errors import InputError
from soilml.parameters import declared
from soilml.physics.soils import Soil
from soilml.remarks import Remark
from soilml.report.numbers import decimal
from soilml.results import Result
from training.adaptation.judgement import ChannelScore, Judgement

if TYPE_CHECKING:
    from soilml.report.report import Report

#: Status of an adaptation, and its meaning.
ADAPTATION_STATUSES = {
    "adapted": "the adapted file predicts the runs that were kept back better than the old one",
    "not-better": "an adapted file was trained, and the old one predicts those runs no worse",
    "not-judged": "an adapted file was trained, and the campaign has too few runs to judge it",
    "not-supported": "the gap analysis does not support a change of the model",
}


@dataclass(frozen=True, repr=False)
class AdaptReport(Result):
    """The result of `adapt`.

    Attributes
    ----------
    status : str
        One of `ADAPTATION_STATUSES`; with `not-better` and `not-supported` the old file stays.
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
        from training.adaptation.page import report_of_adaptation

        return report_of_adaptation(self)

    def frame_columns(self) -> dict[str, Any]:
        """A row for each channel and number of first rows: errors and log scores of both files.

        Raises `InputError` where no file was judged.
        """
        if self.judgement is None:
            raise InputError("no file was judged, so that there are no figures")
        rows = [
            (key, k, before, after)
            for k in self.judgement.lengths
            for key, (before, after) in self.judgement.figures(k).items()
        ]
        return {
            "predicted": [row[0] for row in rows],
            "first_rows": [row[1] for row in rows],
            "error_before": [row[2].error for row in rows],
            "error_after": [row[3].error for row in rows],
            "log_score_before": [row[2].log_score for row in rows],
            "log_score_after": [row[3].log_score for row in rows],
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
            content["judgement"] = _judgement_json(self.judgement)
        return content


def _judgement_json(judgement: Judgement) -> dict[str, Any]:
    before, after = judgement.error()
    units = {name: parameter.unit for name, parameter in declared(Soil).items()}
    return {
        "error_ratio": judgement.ratio,
        "error": {"before": before, "after": after},
        "by_first_rows": {
            str(k): {key: _pair(b, a) for key, (b, a) in judgement.figures(k).items()}
            for k in judgement.lengths
        },
        "runs": [
            {
                "run": run.run,
                "first_rows": run.first_rows,
                "later_rows": len(run.rows),
                "in_range": {
                    "before": bool(run.before.estimate.in_range),
                    "after": bool(run.after.estimate.in_range),
                },
                "channels": {
                    key: _pair(run.scores_before[key], run.scores_after[key])
                    for key in run.scores_before
                },
            }
            for run in judgement.runs
        ],
        "soil_error": {
            name: {"before": b, "after": a, "unit": units.get(name, "")}
            for name, (b, a) in judgement.soil_error.items()
        },
    }


def _pair(before: ChannelScore, after: ChannelScore) -> dict[str, dict[str, float]]:
    return {"before": dict(vars(before)), "after": dict(vars(after))}
