"""The page of `estimate`: estimates of a trained model, from their columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.cli.reports.parameter_lines import (
    AS_RIGHT,
    WITH_ERRORS,
    parameter_lines,
    parameter_table,
)
from soilml.errors import InputError
from soilml.onboard.estimator import Estimator
from soilml.quantities import column
from soilml.report.figure_style import picture
from soilml.report.page import Report, ReportPicture
from soilml.report.parameter_figure import ParameterIntervals

Floats = NDArray[np.float64]

#: Ending of the columns of the second answer.
USUAL = "usual"
#: Most estimates of a page, whose JSON file has every one, and most that are put in sentences.
MOST_ESTIMATES, _MOST_SENTENCES = 20_000, 4


def check_size(rows: int) -> None:
    """Raise `InputError` for more estimates than a page is for."""
    if rows > MOST_ESTIMATES:
        raise InputError(
            f"--report of {rows} estimates; at most {MOST_ESTIMATES} are possible: pool rows with "
            "--by run, select some with --where, or take --out"
        )


def estimate_report(
    columns: Mapping[str, Any],
    notes: Sequence[str],
    estimator: Estimator,
    by: str | None,
    files: tuple[str, str],
) -> Report:
    """The page of estimates in columns (n,): model file and table that they are of."""
    names, units, prior = estimator.names, estimator.units, estimator.prior
    group = by or "row"
    answers = [_answer(columns, names, by, "")]
    if f"in_range_{USUAL}" in columns:
        answers.insert(0, _answer(columns, names, by, f"_{USUAL}"))
    labels = np.concatenate([a.labels for a in answers])
    values, std, low, high = (
        np.concatenate([getattr(a, key) for a in answers])
        for key in ("values", "std", "low", "high")
    )
    inside = np.concatenate([a.inside for a in answers])
    answered = np.isfinite(values).any(axis=1)
    lines = {
        str(labels[i]): parameter_lines(
            names, units, values[i], std[i], low[i], high[i],
            [float(x) if inside[i] else 1.0 for x in std[i] / prior.std],
        )
        for i in np.flatnonzero(answered)
    }  # fmt: skip
    if len(lines) <= _MOST_SENTENCES:
        answer = [
            f"{group.capitalize()} {name}: {' '.join(x.sentence for x in own)}"
            for name, own in lines.items()
        ]
    else:
        answer = [
            f"{len(lines)} estimates, one for each {group}: "
            + ", ".join(
                f"{known} determine {line.name}"
                for line, known in zip(
                    next(iter(lines.values())),
                    np.sum([[x.known for x in own] for own in lines.values()], axis=0),
                    strict=True,
                )
            )
            + "."
        ]
    outside = int(np.count_nonzero(answered & ~inside))
    badge = "in range" if outside == 0 else "out of range" if outside == len(lines) else "mixed"
    drawn = ParameterIntervals(
        names, units, list(lines), values[answered], low[answered], high[answered],
        prior.lower, prior.upper,
    )  # fmt: skip
    return Report(
        kind="estimate",
        title=f"Estimates of {Path(files[1]).name} by {Path(files[0]).name}",
        badge=badge,
        meaning=f"{len(lines) - outside} of {len(labels)} estimates are in the range of the "
        "training, and explained",
        answer=answer,
        tone="named" if outside == 0 else "suspected",
        pictures=[
            ReportPicture(
                "Estimates and 90 % intervals",
                picture(drawn.plot, len(names), 1, drawn.size, answer[0]),
                "Grey: the range of the prior.",
            )
        ],
        tables=[parameter_table(lines, group)],
        warnings=[_without_columns(note) for note in notes if not _is_step(note)],
        next_steps=[note for note in notes if _is_step(note)],
        notation=[
            ("±", "one standard deviation of the error that is expected."),
            ("90 %", "interval that holds the value with that probability, under model and noise."),
            ("left of prior", "width of the estimate over that of the prior."),
        ],
    )


@dataclass(frozen=True)
class _Answer:
    labels: NDArray[np.str_]
    values: Floats
    std: Floats
    low: Floats
    high: Floats
    inside: NDArray[np.bool_]


def _answer(columns: Mapping[str, Any], names: Sequence[str], by: str | None, end: str) -> _Answer:
    """Estimates (n, q) of the columns that end so: `_usual` for the second answer."""
    values, std, low, high = (
        np.stack([np.asarray(columns[column(n) + end + part], float) for n in names], axis=1)
        for part in ("", "_std", "_p05", "_p95")
    )
    own = columns[by] if by else np.arange(1, len(values) + 1)
    said = {"": "" if f"in_range_{USUAL}" not in columns else f", {AS_RIGHT}"}
    text = said.get(end, f", {WITH_ERRORS}")
    labels = np.asarray([f"{name}{text}" for name in own], dtype=np.str_)
    inside = np.nan_to_num(np.asarray(columns[f"in_range{end}"], float)) > 0.5
    return _Answer(labels, values, std, low, high, np.asarray(inside))


def _is_step(note: str) -> bool:
    """Whether a note names the next measurement."""
    return "next row" in note or "Most informative next" in note


def _without_columns(note: str) -> str:
    """The note with the names that the two answers have on a page."""
    note = note.replace(f"columns without _{USUAL}", f"those marked “{AS_RIGHT}”")
    return note.replace(f"columns with _{USUAL}", f"those marked “{WITH_ERRORS}”")
