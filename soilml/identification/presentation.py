"""The result of `identify`, and that with typical errors beside it, as text, JSON and page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification import CLOSED_FORM, identify
from soilml.identification.fit import Fit
from soilml.io.table import Table
from soilml.io.text_tables import format_table
from soilml.remarks import Remark, about, texts
from soilml.report import numbers
from soilml.report.figure_style import picture
from soilml.report.page import Report, ReportPicture
from soilml.report.parameter_figure import ParameterIntervals
from soilml.report.parameter_lines import (
    MODEL_EXACT,
    TYPICAL_ERRORS,
    ParameterLine,
    parameter_lines,
    parameter_table,
)
from soilml.report.terminal import interval, rounded, shown_unit

_MOST_SENTENCES = 4  # Most results that the page describes in sentences; more are in its table


@dataclass(frozen=True)
class TypicalErrorFit:
    """The fit with typical errors, and the one that takes the model as exact."""

    exact: Fit
    typical: Fit

    def as_json(self) -> dict[str, Any]:
        """The content of `as_usual` in the file."""
        content = self.typical.as_json()
        note = self.remark().as_json()
        return {key: content[key] for key in ("parameters", "misfit")} | {"note": note}

    def remark(self) -> Remark:
        """Which of the two intervals to use."""
        if _explains(self.exact):
            return Remark(
                "use-typical-errors",
                "use the interval that includes typical errors, unless this model was verified on "
                "a known soil: the other takes wheel, soil and sensors to be exactly as in the "
                "model file",
            )
        if _explains(self.typical):
            return Remark(
                "use-typical-errors",
                "the model taken as exact does not explain the rows, with typical errors it does: "
                "use the interval that includes them",
            )
        return Remark(
            "no-interval-explains",
            "the rows are explained neither by the model taken as exact nor with typical errors: "
            "use neither interval, and run soilml gap",
        )


def _explains(fit: Fit) -> bool:
    return all(remark.code != "excess-residuals" for remark in fit.warnings)


def fit_with_typical_errors(
    case: Case, rows: Table, free: Sequence[str] | None, method: str, exact: Fit
) -> TypicalErrorFit | None:
    """The fit with typical errors beside `exact`, or None.

    None for a method that takes the model as exact, where the case states the error of its model,
    and where no fit is possible with typical errors.
    """
    if method in CLOSED_FORM or case.discrepancy:
        return None
    try:
        typical = identify(case, rows, free, method, as_usual=True)
        return TypicalErrorFit(exact, replace(typical, samples=None))
    except FitError:
        return None


@dataclass(frozen=True)
class Identification:
    """A fit, that with typical errors beside it, and the next measurement that is advised.

    `advice` has the further entries of the file that say the same as `next_rows`.
    """

    fit: Fit
    typical: TypicalErrorFit | None = None
    next_rows: tuple[Remark, ...] = ()
    advice: Mapping[str, Any] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """The content of the file, for one fit."""
        typical = {} if self.typical is None else {"as_usual": self.typical.as_json()}
        return self.fit.as_json() | typical | dict(self.advice)

    def text(self) -> str:
        """The fit as a table, its warnings, that with typical errors, and the advice."""
        typical = [] if self.typical is None else ["", _typical_text(self.typical)]
        messages = ["", *texts(self.next_rows)] if self.next_rows else []
        return "\n".join([_fit_text(self.fit), *typical, *messages])


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
    # the answer to use decides: the first one of each group
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
        remark.under(head[name]) for name, one in found.items() for remark in one.fit.warnings
    ]
    warnings += [
        one.typical.remark().under(head[name])
        for name, one in found.items()
        if one.typical is not None
    ]
    warnings += [
        Remark("no-result", f"{by} {name} has no result: {why}", (name,))
        for name, why in failed.items()
    ]
    steps = [f"{head[name]}{row}" for name, one in found.items() for row in one.next_rows]
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
            ("90 %", "interval that covers the value with that probability, by model and noise."),
            ("left of prior", "width of the estimate over that of the prior; blank without one."),
        ],
    )


def _answers(found: Mapping[str, Identification], by: str | None) -> dict[str, Fit]:
    """The fits by what they are called on the page; those to be used first."""
    typical, exact = {}, {}
    for name, one in found.items():
        head = f"{by} {name}" if by else ""
        if one.typical is None:
            exact[head] = one.fit
        else:
            typical[f"{head}, {TYPICAL_ERRORS}".removeprefix(", ")] = one.typical.typical
            exact[f"{head}, {MODEL_EXACT}".removeprefix(", ")] = one.fit
    return typical | exact


def _picture(case: Case, answers: Mapping[str, Fit]) -> ReportPicture:
    parts = [fit.intervals(case.prior, label) for label, fit in answers.items()]
    whole = ParameterIntervals(
        names=parts[0].names,
        units=parts[0].units,
        labels=[name for part in parts for name in part.labels],
        values=np.concatenate([part.values for part in parts]),
        low=np.concatenate([part.low for part in parts]),
        high=np.concatenate([part.high for part in parts]),
        prior_low=parts[0].prior_low,
        prior_high=parts[0].prior_high,
    )
    text = "; ".join(line.sentence for line in _lines(next(iter(answers.values()))))
    image = picture(whole.plot, len(whole.names), 1, whole.size, text)
    shaded = any(np.isfinite(whole.prior_low))
    caption = "Grey: the range of the prior." if shaded else ""
    return ReportPicture("Estimates and 90 % intervals", image, caption)


def _lines(fit: Fit) -> list[ParameterLine]:
    left = [fit.remaining_fraction.get(name) for name in fit.names]
    doubted = about(fit.warnings, "not-identified")
    low, high = fit.interval
    return parameter_lines(
        names=fit.names,
        units=fit.units,
        values=fit.values,
        std=fit.std,
        low=low,
        high=high,
        left=left,
        doubted=doubted,
    )


def _fit_text(found: Fit) -> str:
    remaining = found.remaining_fraction
    rows = [
        (*cells, f"{remaining[cells[0]]:.0%}" if cells[0] in remaining else "")
        for cells in _cells(found)
    ]
    head = ("parameter", "value", "std", "90 % interval", "unit", "posterior/prior")
    warnings = "\n".join(f"! {text}" for text in found.warnings)
    first = f"{found.method}, {found.rows_used} rows, channels: {', '.join(found.channels)}"
    return f"{first}\n\n{format_table(head, rows)}\n{warnings}".rstrip()


def _typical_text(found: TypicalErrorFit) -> str:
    """The interval with typical errors in a table, and which one to use."""
    ratios = found.typical.std / found.exact.std
    rows = [(*cells, f"{r:.1f}") for cells, r in zip(_cells(found.typical), ratios, strict=True)]
    head = ("parameter", "value", "std", "90 % interval", "unit", "times std above")
    return f"with typical model and sensor errors\n\n{format_table(head, rows)}\n! {found.remark()}"


def _cells(fit: Fit) -> list[tuple[str, str, str, str, str]]:
    """Name, value, std, 90 % interval and unit of each parameter, as a terminal shows them."""
    rows = []
    for name, value, std, low, high, unit in zip(
        fit.names, fit.values, fit.std, *fit.interval, fit.units, strict=True
    ):
        factor, shown = shown_unit(unit, float(abs(value)))
        value, std, low, high = (factor * float(v) for v in (value, std, low, high))
        rows.append((name, rounded(value, std), rounded(std, std), interval(low, high, std), shown))
    return rows
