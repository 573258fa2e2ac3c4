"""The result of `identify` as text, JSON and page."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.fitting.coordinates import select_free
from soilml.identification.fit import Fit
from soilml.io.text_tables import format_table
from soilml.parameters import declared
from soilml.physics.soils import Soil
from soilml.remarks import Remark, about, texts
from soilml.report import numbers
from soilml.report.figure_style import picture
from soilml.report.page import Report, ReportPicture
from soilml.report.parameter_figure import ParameterIntervals
from soilml.report.parameter_lines import ParameterLine, headline, parameter_lines, parameter_table
from soilml.report.terminal import interval, rounded, shown_unit

#: Draws of the soil in the file: the standard error of a standard deviation is then 4 %.
STORED_DRAWS = 400
_MOST_EXPLANATIONS = 4  # Most explanations that a terminal shows
_MOST_SENTENCES = 4  # Most results that the page describes in sentences; more are in its table


@dataclass(frozen=True)
class Identification:
    """A fit, and the next measurement that is advised.

    `advice` has the further entries of the file that say the same as `next_rows`, `soil` those of
    the whole soil.
    """

    fit: Fit
    next_rows: tuple[Remark, ...] = ()
    advice: Mapping[str, Any] = field(default_factory=dict)
    soil: Mapping[str, Any] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """The content of the file, for one fit."""
        return self.fit.as_json() | dict(self.advice) | dict(self.soil)

    def text(self) -> str:
        """The verdict, the fit as a table, its warnings, and the advice."""
        messages = ["", *texts(self.next_rows)] if self.next_rows else []
        return "\n".join([_fit_text(self.fit), *messages])


def soil_entries(
    case: Case, fit: Fit, free: Sequence[str] | None, with_draws: bool
) -> dict[str, Any]:
    """Entries of the file with which other programs know the whole soil, in SI units.

    `model` has the effects and every parameter of the soil, at its value in the model file where it
    was not identified. `draws` has equally likely values of the identified ones, where the method
    drew samples and `with_draws`.
    """
    known = {name: float(getattr(case.soil, name)) for name in declared(Soil)}
    found = dict(zip(fit.names, fit.values.tolist(), strict=True))
    soil = {name: found.get(name, value) for name, value in known.items()}
    effects = [effect.name for effect in case.model.effects]
    entries: dict[str, Any] = {"model": {"soil": soil, "effects": effects}}
    if with_draws and fit.samples is not None:
        u = fit.samples.sample.u[fit.samples.equally_weighted(STORED_DRAWS)]
        entries["draws"] = {
            own.path: [float(f"{value:.7g}") for value in own.prior.at(u[:, i])]
            for i, own in enumerate(select_free(case, free))
        }
    return entries


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
    every = [line for own in lines.values() for line in own]
    first = next(iter(found.values())).fit
    known, total = sum(line.known for line in every), len(every)
    fits = all(one.fit.fits for one in found.values())
    badge = "identified" if known == total else "partly identified" if known else "not identified"
    head = {name: f"{by} {name}: " if by else "" for name in (*found, *failed)}
    if not fits:
        badge = "the model does not fit"
    if len(found) <= _MOST_SENTENCES:
        answer = [head[name] + one.fit.verdict for name, one in found.items()]
        answer += [
            (f"{numbers.capitalised(label)}: " if label else "") + headline(own)
            for label, own in lines.items()
        ]
    else:
        answer = [f"The table has a result for each of {len(found)} values of {by}."]
    warnings = [
        remark.under(head[name]) for name, one in found.items() for remark in one.fit.warnings
    ]
    warnings += [
        Remark("no-result", f"{by} {name} has no result: {why}", (name,))
        for name, why in failed.items()
    ]
    steps = [f"{head[name]}{row}" for name, one in found.items() for row in one.next_rows]
    steps.append("soilml gap tells whether the model explains the rows.")
    rows = sum(one.fit.rows_used for one in found.values())
    channels = ", ".join(numbers.channel_name(c) for c in first.channels)
    return Report(
        kind="identify",
        title=f"Soil of {Path(files[1]).name}, by the model {Path(files[0]).name}",
        badge=badge,
        meaning=f"from {rows} rows by the method {first.method}; channels: {channels}",
        answer=answer,
        tone="named" if known == total and fits else "suspected",
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
    """The fits by what they are called on the page."""
    return {f"{by} {name}" if by else "": one.fit for name, one in found.items()}


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
    """The headline, where nothing is determined that; the table, explanations and warnings."""
    remaining, unknown = found.remaining_fraction, _undetermined(found)
    rows = [
        (*cells, f"{remaining[cells[0]]:.0%}" if cells[0] in remaining else "")
        for cells in _cells(found, unknown)
    ]
    head = ("parameter", "value", "std", "90 % interval", "unit", "posterior/prior")
    first = f"{found.method}, {found.rows_used} rows, channels: {', '.join(found.channels)}"
    first = f"{found.verdict}\n\n{first}"
    by = ""
    if found.explanations:
        shown = found.explanations[:_MOST_EXPLANATIONS]
        by = f"\nexplained by: {', '.join(f'{one} ({one.probability:.0%})' for one in shown)}"
    warnings = "".join(f"\n! {text}" for text in found.warnings)
    return f"{first}\n\n{format_table(head, rows)}{by}{warnings}"


def _undetermined(fit: Fit) -> frozenset[str]:
    """The parameters that a warning says are not identified."""
    return frozenset(about(fit.warnings, "not-identified"))


def _cells(fit: Fit, unknown: Container[str]) -> list[tuple[str, str, str, str, str]]:
    """Name, value, std, 90 % interval and unit of each parameter, as a terminal shows them.

    No value stands beside what is not determined.
    """
    rows = []
    for name, value, std, low, high, unit in zip(
        fit.names, fit.values, fit.std, *fit.interval, fit.units, strict=True
    ):
        factor, shown = shown_unit(unit, float(abs(value)))
        value, std, low, high = (factor * float(v) for v in (value, std, low, high))
        stated = rounded(value, std), rounded(std, std)
        if name in unknown:
            stated = "not determined", ""
        rows.append((name, *stated, interval(low, high, std), shown))
    return rows
