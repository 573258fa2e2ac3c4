"""Estimates of a trained model as columns, remarks and a page; what a model file is for."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.onboard.estimate import Estimate, Reason
from soilml.onboard.estimator import Estimator
from soilml.quantities import NOT_IDENTIFIED_ABOVE, column
from soilml.remarks import NEXT_ROW, Remark
from soilml.report.column_figure import ParameterIntervals
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


def estimate_columns(estimate: Estimate) -> dict[str, NDArray[np.float64]]:
    """Mean, std and interval of every parameter, by column name."""
    columns = estimate.reading_columns()
    del columns["in_range"]
    return columns


def verdict(columns: Mapping[str, Any], by: str | None, remarks: Sequence[Remark]) -> str:
    """How many rows or groups are estimated, and what they do not determine, in one sentence."""
    known = np.asarray(columns["in_range"])
    what = f"{by or 'row'}{'' if known.size == 1 else 's'}" if by != "all" else "set of all rows"
    are = "is" if known.size == 1 else "are"
    head = f"{int(known.sum())} of {known.size} {what} {are} estimated"
    if any(remark.code == "rows-disagree" for remark in remarks):
        return f"{head}; rows disagree with the model: run `soilml gap`."
    vague = [name for remark in remarks if remark.code == "not-identified" for name in remark.about]
    names = " and ".join(_words(name) for name in dict.fromkeys(vague))
    return f"{head}; {names} mostly from the prior." if vague else f"{head}."


def _relative_width(estimate: Estimate) -> NDArray[np.float64]:
    """RMS over the parameters of posterior width / prior width, (rows,); NaN out of range."""
    widths = np.sqrt(np.mean((estimate.std / estimate.prior_std) ** 2, axis=1))
    return np.where(estimate.in_range, widths, np.nan)


def median_row(estimate: Estimate) -> int:
    """The row in range with the median width."""
    widths = _relative_width(estimate)
    return int(np.argsort(widths)[(int(estimate.in_range.sum()) - 1) // 2])


def widest_row(estimate: Estimate) -> int:
    """The row in range with the largest width."""
    return int(np.nanargmax(_relative_width(estimate)))


def width_remarks(estimate: Estimate, what: str, does: str, hint: str) -> list[Remark]:
    """Median width of the estimates in range over the prior's; parameters not determined."""
    if not estimate.in_range.any():
        return []
    share = np.median(estimate.std[estimate.in_range], axis=0) / estimate.prior_std
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


def _words(name: str) -> str:
    return name.replace("_", " ")


def refusal_remarks(
    by: str,
    names: Sequence[Any],
    outside: NDArray[np.int64],
    rows: NDArray[np.int64],
    estimate: Estimate,
) -> list[Remark]:
    """Why runs (n,) are not in range, and what their estimate is then; rows that were set aside.

    `outside` and `rows` are the rows out of range, and all rows, of each.
    """
    found = []
    for i, name in enumerate(names):
        reason, aside = Reason(int(estimate.reason[i])), bool(outside[i])
        of_rows = f"{outside[i]} of {rows[i]} rows are out of range"
        if reason == Reason.ESTIMATED and aside:
            text = f"{of_rows}; they are set aside, and the estimate is that of the others"
            found.append((name, Remark("rows-set-aside", text, severity="note")))
        if estimate.disagrees[i] and reason != Reason.INCONSISTENT:
            found.append((name, Remark("rows-disagree", DISAGREES)))
        if reason == Reason.ESTIMATED:
            continue
        why, what = reason.words, "the estimate is the prior"
        if reason == Reason.OUT_OF_RANGE:
            why = of_rows
        if reason == Reason.INCONSISTENT:
            what = "the estimate is widened as far as the misfit says"
        code = reason.name.lower().replace("_", "-")
        found.append((name, Remark(code, f"{why}; {what}")))
    return remarks_on_runs(by, found)


def remarks_on_runs(by: str, found: Sequence[tuple[Any, Remark]]) -> list[Remark]:
    """The remarks with the names of their runs: one each, or one for many runs with the same."""
    runs: dict[Remark, list[str]] = {}
    for name, remark in found:
        runs.setdefault(remark, []).append(str(name))
    remarks = []
    for remark, names in runs.items():
        heads: dict[str, tuple[str, ...]] = {name: (name,) for name in names}
        if len(names) > MOST_LINES:
            heads = {f"{', '.join(names[:3])} and {len(names) - 3} more": tuple(names)}
        remarks += [
            replace(remark.under(f"{by} {head}: "), about=about) for head, about in heads.items()
        ]
    return remarks


def check_size(rows: int) -> None:
    """Raise `InputError` for more estimates than a page is for."""
    if rows > MOST_ESTIMATES:
        raise InputError(
            f"--report of {rows} estimates; at most {MOST_ESTIMATES} are possible: pool rows with "
            "--by run, select some with --where, or take --out"
        )


def estimate_report(
    columns: Mapping[str, Any],
    remarks: Sequence[Remark],
    estimator: Estimator,
    by: str | None,
    title: str = "Estimates",
) -> Report:
    """The report of estimates in columns (n,), a row of the table or a group each."""
    names, prior, group = estimator.names, estimator.prior, by or "row"
    values, low, high = (
        np.stack([np.asarray(columns[column(n) + part], float) for n in names], axis=1)
        for part in ("", "_p05", "_p95")
    )
    labels = np.asarray(columns[by] if by else np.arange(1, len(values) + 1)).astype(np.str_)
    inside = np.nan_to_num(np.asarray(columns["in_range"], float)) > 0.5
    answered = np.isfinite(values).any(axis=1)
    outside = int(np.count_nonzero(answered & ~inside))
    drawn = ParameterIntervals(
        names=names,
        units=estimator.units,
        labels=labels[answered].tolist(),
        values=values[answered],
        low=low[answered],
        high=high[answered],
        prior_low=prior.lower,
        prior_high=prior.upper,
    )
    status = "in range" if not outside else "mixed" if inside.any() else "out of range"
    return Report(
        kind="estimate",
        verdict=verdict(columns, by, remarks),
        tables=[ReportTable.of("Estimates", columns)],
        pictures=[drawn.picture()],
        remarks=[remark for remark in remarks if remark.code != NEXT_ROW],
        next_steps=[remark.text for remark in remarks if remark.code == NEXT_ROW],
        status=status,
        tone="warn" if outside else "good",
        title=title,
        basis=f"{int(inside.sum())} of {len(labels)} estimates, one for each {group}, are in the "
        "range of the training",
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
