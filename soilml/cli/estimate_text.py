"""Estimates as columns of a table, and what `estimate` says about them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.experiment_design import is_identified
from soilml.onboard.estimate import Estimate, Reason
from soilml.quantities import column

#: Runs that are told the same thing have a line each up to this number, and one together beyond it.
MOST_LINES = 10


def estimate_columns(estimate: Estimate) -> dict[str, NDArray[np.float64]]:
    """Mean, std and interval of every parameter, by column name."""
    columns = {}
    for i, name in enumerate(estimate.names):
        key = column(name)
        columns[key] = estimate.mean[:, i]
        columns[f"{key}_std"] = estimate.std[:, i]
        columns[f"{key}_p05"] = estimate.low[:, i]
        columns[f"{key}_p95"] = estimate.high[:, i]
    return columns


def width_notes(estimate: Estimate, what: str, does: str, hint: str) -> list[str]:
    """Median width of the estimates in range over the prior's; parameters not determined."""
    if not estimate.in_range.any():
        return []
    share = np.median(estimate.std[estimate.in_range], axis=0) / estimate.prior_std
    names = [name.replace("_", " ") for name in estimate.names]
    shares = ", ".join(f"{name} {s:.0%}" for name, s in zip(names, share, strict=True))
    notes = [f"posterior width / prior width, {what}: {shares}"]
    vague = [name for name, ok in zip(names, is_identified(share), strict=True) if not ok]
    if vague:
        notes.append(
            f"{' and '.join(vague)}: the estimate is mostly the prior, {what} {does} not determine "
            f"{'it' if len(vague) == 1 else 'them'}; {hint} for a better estimate"
        )
    return notes


def refusal_notes(
    by: str,
    names: Sequence[Any],
    outside: NDArray[np.int64],
    rows: NDArray[np.int64],
    estimate: Estimate,
) -> list[str]:
    """Why runs (n,) are not in range, and what their estimate is then.

    `outside` and `rows` are the rows out of range, and all rows, of each.
    """
    told = []
    for i, name in enumerate(names):
        if estimate.in_range[i]:
            continue
        reason, what = Reason(int(estimate.reason[i])), "the estimate is the prior"
        why = reason.words
        if reason == Reason.OUT_OF_RANGE:
            why = f"{outside[i]} of {rows[i]} rows are out of range"
        if reason == Reason.INCONSISTENT:
            what = "the estimate is widened as far as the misfit says"
        told.append((name, f"{why}; {what}"))
    return notes_on_runs(by, told)


def notes_on_runs(by: str, told: Sequence[tuple[Any, str]]) -> list[str]:
    """A line for each run that is told something; one for many that are told the same."""
    names: dict[str, list[str]] = {}
    for name, sentence in told:
        names.setdefault(sentence, []).append(str(name))
    lines = []
    for sentence, own in names.items():
        if len(own) > MOST_LINES:
            own = [f"{', '.join(own[:3])} and {len(own) - 3} more"]
        lines += [f"{by} {name}: {sentence}" for name in own]
    return lines
