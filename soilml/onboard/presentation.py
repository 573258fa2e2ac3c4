"""Estimates of a trained model as columns, remarks and a page; what a model file is for."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.io.table import ALL, Table
from soilml.onboard.estimate import Reason
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import INFERRED, MODEL_ERROR_INPUT
from soilml.onboard.table_estimates import (
    ERRORS_SHOWN,
    TableEstimates,
    complete_rows,
    joint_readings,
    sensor_errors_shown,
)
from soilml.quantities import CHANNELS, NOT_IDENTIFIED_ABOVE
from soilml.remarks import Remark
from soilml.report.numbers import shown_unit, significant
from soilml.report.report import Report
from soilml.report.tables import ReportTable

MOST_ESTIMATES = 20_000  # Most estimates of a page, whose JSON file has every one
#: What the fault detector says of a run.
DISAGREES = (
    "the rows disagree with the exact model, as one in a hundred sound sets does; the interval "
    "allows for errors of the model, not for a fault: check units, definition of slip, sensors, "
    "and wheel"
)
#: Runs with the same remark have a line each up to this number, and one together beyond it.
MOST_LINES = 10


def description(estimator: Estimator) -> Remark:
    """What a model file is for, in one line: gear, effects, estimated quantities with their prior.

    Bounds of the prior that a context input scales are given by its name until it is set.
    """
    gear = dict(json.loads(estimator.metadata["gear"]))
    limits = {} if estimator.sets is None else estimator.sets.context_ranges
    fixed = {} if estimator.sets is None else estimator.sets.context_values
    for name in ("radius", "width"):
        gear[name] = fixed.get(f"wheel_{name}", gear.get(name, limits.get(f"wheel_{name}")))
    sizes = [f"{k} {_number(v)}" for k, v in gear.items() if k != "type" and v is not None]
    effects = [e["name"] for e in json.loads(estimator.metadata["recipe"]).get("effect", [])]
    with_effects = f"with {', '.join(effects)}" if effects else "without effects"
    priors = [
        f"{entry['name'].replace('_', ' ')} {_prior_text(ends[0], ends[1], entry['unit'])}"
        if (scale := entry.get("scale")) is None or scale in fixed
        else f"{entry['name'].replace('_', ' ')} {entry['lower']:.3g} to 1 {scale}"
        for entry, *ends in zip(
            json.loads(estimator.metadata["outputs"]),
            estimator.prior.lower,
            estimator.prior.upper,
            strict=True,
        )
    ]
    text = (
        f"{estimator.path}: for a {gear.get('type', 'gear that it does not state')}"
        f"{' of ' if sizes else ''}{', '.join(sizes)}, {with_effects}; reads "
        f"{', '.join(estimator.inputs)}; estimates {', '.join(priors)}"
    )
    return Remark("model-file", text, estimator.names, "note")


def _prior_text(low: float, high: float, unit: str) -> str:
    """A range in the unit in which a terminal shows it."""
    factor, shown = shown_unit(unit, high)
    return f"{significant(factor * low)} to {significant(factor * high)} {shown}".rstrip()


def verdict(columns: Mapping[str, Any], by: str | None, remarks: Sequence[Remark]) -> str:
    """How many rows or groups are estimated, and what they do not determine, in one sentence."""
    known = np.asarray(columns["in_range"])
    what = f"{by or 'row'}{'' if known.size == 1 else 's'}" if by != "all" else "set of all rows"
    are = "is" if known.size == 1 else "are"
    head = f"{int(known.sum())} of {known.size} {what} {are} estimated"
    if not {"rows-disagree", "inconsistent"}.isdisjoint(remark.code for remark in remarks):
        return f"{head}; rows disagree with the model: run `soilml gap`."
    vague = [name for remark in remarks if remark.code == "not-identified" for name in remark.about]
    names = " and ".join(_words(name) for name in dict.fromkeys(vague))
    if vague:
        return f"{head}; {names} mostly from the prior."
    outside = any(remark.code == "out-of-range" for remark in remarks)
    rest = "the others are" if known.any() else "it is" if known.size == 1 else "they are"
    return f"{head}; {rest} outside what the file was trained for." if outside else f"{head}."


def _words(name: str) -> str:
    return name.replace("_", " ")


def remarks_on(found: TableEstimates, estimators: Sequence[Estimator]) -> list[Remark]:
    """What to know of estimates: what they use and do not determine, and rows without one."""
    first, table, by = estimators[0], found.table, found.by
    remarks = [] if by is None else _channel_remarks(first, table)
    remarks += _width_remarks(found)
    remarks += _row_refusals(found) if by is None else _group_refusals(found)
    some = np.any([complete_rows(estimator, table) for estimator in estimators], axis=0)
    unanswered = some & ~table.answered
    remarks += _excluded_rows(table, ~some, "missing-reading", "lack a reading")
    return remarks + _excluded_rows(
        table, unanswered, "status-not-ok", "have a status that is not ok"
    )


def _width_remarks(found: TableEstimates) -> list[Remark]:
    """Median width of the estimates in range over the prior's; parameters not determined."""
    estimate, by = found.estimate, found.by
    inside = found.answered & estimate.in_range
    if not inside.any():
        return []
    what, does, hint = "a single row", "does", "pool rows with --by run"
    if by is None and found.estimator.per_row:
        hint = "measure with other sensors too, or train for a narrower prior of the soil,"
    if by is not None:
        what, does = "all rows" if by == ALL else f"all rows of a {by}", "do"
        hint = "measure other loads and slips"
        if by != ALL and found.answered.sum() > 1:
            hint += f", or take those of one soil together, such as --by {ALL},"
    share = np.median(estimate.std[inside], axis=0) / estimate.prior_std
    shares = ", ".join(f"{_words(n)} {s:.0%}" for n, s in zip(estimate.names, share, strict=True))
    text = f"posterior width / prior width, {what}: {shares}"
    remarks = [Remark("width", text, estimate.names, "note")]
    vague = [n for n, s in zip(estimate.names, share, strict=True) if s > NOT_IDENTIFIED_ABOVE]
    if vague:
        text = (
            f"{' and '.join(map(_words, vague))}: the estimate is mostly the prior, {what} {does} "
            f"not determine {'it' if len(vague) == 1 else 'them'}; {hint} for a better estimate"
        )
        remarks.append(Remark("not-identified", text, tuple(vague)))
    return remarks


def _channel_remarks(estimator: Estimator, table: Table) -> list[Remark]:
    """Notes on the channels and errors that a file uses which can use more than it requires."""
    if estimator.sets is None:
        return []
    usable = complete_rows(estimator, table) & table.answered
    readings = joint_readings(estimator, table.rows(usable))
    rows = {name: int(np.isfinite(readings[name]).sum()) for name in CHANNELS if name in readings}
    used = {name: count for name, count in rows.items() if count}
    said = ", ".join(f"{_words(name)} ({count} rows)" for name, count in used.items())
    remarks = [Remark("channels-used", f"uses slip, load and {said}", tuple(used), "note")]
    errors = estimator.sets.common_errors
    stds = {n: std for n, std in errors.items() if std > 0.0 and n in ERRORS_SHOWN}
    if stds:
        text = "assumes that all rows share errors with standard deviations of "
        text += sensor_errors_shown(stds)
        remarks.append(Remark("shared-errors", text, tuple(stds), "note"))
    size = errors.get(MODEL_ERROR_INPUT, 0.0)
    if size == INFERRED:
        text = "errors of the model are included, of a size that follows from the residuals"
    elif size:
        text = f"errors of the model are included, {size:g} times the usual ones"
    else:
        text = "a perfect model is assumed, or one with the errors that the case states"
    return [*remarks, Remark("model-errors", text, severity="note")]


def _row_refusals(found: TableEstimates) -> list[Remark]:
    """How many rows are out of range."""
    outside = int(np.count_nonzero(found.answered & ~found.estimate.in_range))
    if not outside:
        return []
    why = "" if found.files is None else ", or the files contradict each other there"
    text = f"{outside} of {int(found.answered.sum())} rows are out of range{why}: "
    return [Remark("out-of-range", f"{text}their estimate is the prior")]


def _group_refusals(found: TableEstimates) -> list[Remark]:
    """Why groups are not in range, and what their estimate is then; rows that were set aside."""
    runs: dict[Remark, list[str]] = {}
    estimate = found.estimate
    for i in np.flatnonzero(found.answered).tolist():
        reason, aside = Reason(int(estimate.reason[i])), int(estimate.rows_set_aside[i])
        of_rows = f"{aside} of {found.rows[i]} rows are out of range"
        said = []
        if reason == Reason.ESTIMATED and aside:
            text = f"{of_rows}; they are set aside, and the estimate is that of the others"
            said.append(Remark("rows-set-aside", text, severity="note"))
        if estimate.disagrees[i] and reason != Reason.INCONSISTENT:
            said.append(Remark("rows-disagree", DISAGREES))
        if reason != Reason.ESTIMATED:
            why = of_rows if reason == Reason.OUT_OF_RANGE else reason.words
            what = "the estimate is the prior"
            if reason == Reason.INCONSISTENT:
                what = "the estimate is widened as far as the misfit says"
            said.append(Remark(reason.name.lower().replace("_", "-"), f"{why}; {what}"))
        for remark in said:
            runs.setdefault(remark, []).append(str(found.names[i]))
    remarks = []
    for remark, names in runs.items():
        heads: dict[str, tuple[str, ...]] = {name: (name,) for name in names}
        if len(names) > MOST_LINES:
            heads = {f"{', '.join(names[:3])} and {len(names) - 3} more": tuple(names)}
        remarks += [
            replace(remark.under(f"{found.by} {head}: "), about=about)
            for head, about in heads.items()
        ]
    return remarks


def _excluded_rows(table: Table, rows: NDArray[np.bool_], code: str, why: str) -> list[Remark]:
    """A remark on rows that get no estimate: how many, the reason, and the first three."""
    if not rows.any():
        return []
    some = ", ".join(str(table.place(int(i))) for i in np.flatnonzero(rows)[:3])
    more = ", ..." if rows.sum() > 3 else ""
    return [Remark(code, f"{int(rows.sum())} rows {why} and get no estimate: {some}{more}")]


def check_size(rows: int) -> None:
    """Raise `InputError` for more estimates than a page is for."""
    if rows > MOST_ESTIMATES:
        raise InputError(
            f"--report of {rows} estimates; at most {MOST_ESTIMATES} are possible: pool rows with "
            "--by run, select some with --where, or take --out"
        )


def estimate_report(
    found: TableEstimates, columns: Mapping[str, Any], remarks: Sequence[Remark], title: str
) -> Report:
    """The report of estimates with their columns (n,), a row of the table or a group each."""
    answered, inside = found.answered, found.answered & found.estimate.in_range
    labels = np.asarray(found.names if found.by else np.arange(1, len(inside) + 1)).astype(np.str_)
    outside = bool((answered & ~inside).any())
    return replace(
        found.estimate.at(answered).report(labels[answered].tolist()),
        verdict=verdict(columns, found.by, remarks),
        figures=None,
        tables=[ReportTable.of("Estimates", columns)],
        remarks=remarks,
        status="in range" if not outside else "mixed" if inside.any() else "out of range",
        tone="warn" if outside else "good",
        title=title,
        basis=f"{int(inside.sum())} of {len(inside)} estimates, one for each {found.by or 'row'}, "
        "are in the range of the training",
        notation=[
            ("+-", "one standard deviation of the error that is expected."),
            ("90 %", "interval that covers the value with that probability, by model and noise."),
        ],
    )


def _number(value: object) -> str:
    """A number, or the ends of a range."""
    if isinstance(value, tuple):
        return f"{value[0]:.3g} to {value[1]:.3g} m"
    return f"{value:g} m" if isinstance(value, float) else str(value)


def trained_radius(estimator: Estimator) -> float | None:
    """Radius (m) of the wheel of the training; None for a file of any wheel."""
    radius = json.loads(estimator.metadata["gear"]).get("radius")
    return float(radius) if isinstance(radius, int | float) else None
