"""The result of `identify` as text, as JSON and as a page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from soilml.cli.reports.parameter_lines import (
    AS_RIGHT,
    WITH_ERRORS,
    ParameterLine,
    parameter_lines,
    parameter_table,
)
from soilml.cli.usual_errors.usual_fit import UsualFit, fit_cells
from soilml.config.case import Case
from soilml.experiment_design import Advice, is_identified
from soilml.experiment_design.messages import next_row_messages, summary
from soilml.identification.fit_result import Fit
from soilml.io.text_tables import format_table
from soilml.remarks import about
from soilml.report import numbers
from soilml.report.figure_style import picture
from soilml.report.page import Report, ReportPicture
from soilml.report.parameter_figure import ParameterIntervals

#: Most results that the page describes in sentences; more are in its table.
_MOST_SENTENCES = 4


@dataclass(frozen=True)
class Identification:
    """A fit, the one with usual errors, and the next measurement that the posterior advises."""

    fit: Fit
    usual: UsualFit | None = None
    advice: Advice | None = None

    def as_json(self) -> dict[str, Any]:
        """The content of the file, for one fit."""
        content = self.fit.as_json()
        if self.usual is not None:
            content |= {"as_usual": self.usual.as_json()}
        if self.advice is not None:
            identified = is_identified(self.advice.current_fraction).tolist()
            flags = dict(zip(self.advice.names, identified, strict=True))
            content |= {"told": flags, "advice": summary(self.advice)}
        return content

    def text(self) -> str:
        """The fit as a table, its warnings, the second answer, and the advised measurement."""
        usual = [] if self.usual is None else ["", self.usual.text()]
        messages = [] if self.advice is None else ["", *next_row_messages(self.advice)]
        return "\n".join([_fit_text(self.fit), *usual, *messages])


def identify_report(
    case: Case,
    found: Mapping[str, Identification],
    failed: Mapping[str, str],
    by: str | None,
    files: tuple[str, str],
) -> Report:
    """The page of `identify`: results by group, groups without one; model file and table."""
    answers = _answers(found, by)
    lines = {label: _lines(fit) for label, fit in answers.items()}
    # what is believed decides: the first answer of each group
    every = [line for own in list(lines.values())[: len(found)] for line in own]
    first = next(iter(found.values())).fit
    known, total = sum(line.known for line in every), len(every)
    badge = "identified" if known == total else "partly identified" if known else "not identified"
    head = {name: f"{by} {name}: " if by else "" for name in (*found, *failed)}
    if len(answers) <= _MOST_SENTENCES:
        answer = [
            (f"{numbers.capitalised(label)}: " if label else "")
            + " ".join(line.sentence for line in own)
            for label, own in lines.items()
        ]
    else:
        answer = [f"The table has a result for each of {len(found)} values of {by}."]
    warnings = [
        f"{head[name]}{remark}" for name, one in found.items() for remark in one.fit.warnings
    ]
    warnings += [
        head[name] + _with_marks(one.usual.note())
        for name, one in found.items()
        if one.usual is not None
    ]
    warnings += [f"{by} {name} has no result: {why}" for name, why in failed.items()]
    steps = [
        head[name] + text
        for name, one in found.items()
        if one.advice is not None
        for text in next_row_messages(one.advice)
    ]
    if first.method != "posterior":
        steps.append("--method posterior tells which measurement would help most.")
    steps.append("soilml gap tells whether the model explains the rows.")
    rows = sum(one.fit.rows_used for one in found.values())
    channels = ", ".join(numbers.channel_name(c) for c in first.channels)
    return Report(
        kind="identify",
        title=f"Soil of {Path(files[1]).name}, by the model {Path(files[0]).name}",
        badge=badge,
        meaning=f"from {rows} rows by the method {first.method}; channels: {channels}",
        answer=answer,
        tone="named" if known == total else "suspected",
        pictures=[_picture(case, answers)],
        tables=[parameter_table(lines, "answer" if len(answers) > 1 else None)],
        warnings=warnings,
        next_steps=steps,
        notation=[
            ("±", "one standard deviation of the error that is expected."),
            ("90 %", "interval that holds the value with that probability, under model and noise."),
            ("left of prior", "width of the estimate over that of the prior; blank without one."),
        ],
    )


def _answers(found: Mapping[str, Identification], by: str | None) -> dict[str, Fit]:
    """The fits by what they are called on the page; those that are to be believed first."""
    usual, right = {}, {}
    for name, one in found.items():
        head = f"{by} {name}" if by else ""
        if one.usual is None:
            right[head] = one.fit
        else:
            usual[f"{head}, {WITH_ERRORS}".removeprefix(", ")] = one.usual.usual
            right[f"{head}, {AS_RIGHT}".removeprefix(", ")] = one.fit
    return usual | right


def _with_marks(note: str) -> str:
    """A note on the two answers with their names on the page."""
    note = note.replace("the second answer", f"the answer “{WITH_ERRORS}”")
    return note.replace("the first is", "the other is")


def _picture(case: Case, answers: Mapping[str, Fit]) -> ReportPicture:
    parts = [fit.intervals(case.prior, label) for label, fit in answers.items()]
    whole = ParameterIntervals(
        parts[0].names,
        parts[0].units,
        [name for part in parts for name in part.labels],
        np.concatenate([part.values for part in parts]),
        np.concatenate([part.low for part in parts]),
        np.concatenate([part.high for part in parts]),
        parts[0].prior_low,
        parts[0].prior_high,
    )
    text = "; ".join(line.sentence for line in _lines(next(iter(answers.values()))))
    image = picture(whole.plot, len(whole.names), 1, whole.size, text)
    shaded = any(np.isfinite(whole.prior_low))
    caption = "Grey: the range of the prior." if shaded else ""
    return ReportPicture("Estimates and 90 % intervals", image, caption)


def _lines(fit: Fit) -> list[ParameterLine]:
    left = [fit.remaining_fraction.get(name) for name in fit.names]
    doubted = about(fit.warnings, "not-identified")
    return parameter_lines(fit.names, fit.units, fit.values, fit.std, *fit.interval, left, doubted)


def _fit_text(found: Fit) -> str:
    remaining = found.remaining_fraction
    rows = [
        (*cells, f"{remaining[cells[0]]:.0%}" if cells[0] in remaining else "")
        for cells in fit_cells(found)
    ]
    table = format_table(
        ("parameter", "value", "std", "90 % interval", "unit", "posterior/prior"), rows
    )
    warnings = "\n".join(f"! {text}" for text in found.warnings)
    head = f"{found.method}, {found.rows_used} rows, channels: {', '.join(found.channels)}"
    return f"{head}\n\n{table}\n{warnings}".rstrip()
