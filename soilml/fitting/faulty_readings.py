"""Readings that a sensor or logger spoilt: repeated, held or clipped values, coarse steps, columns
that are copies.

Readings are compared to the last digit. Equal readings are a fault only where noise hardly makes
them: a sensor with steps of q and noise of standard deviation sigma reads the same value twice with
a probability of about q / (2 sqrt(pi) sigma), the density of the difference of two readings at 0.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import TableError
from soilml.fitting.readings import declared_std
from soilml.io.table import Table
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark, Severity

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

#: Expected number of equal readings by chance up to which those that are found are a fault.
BY_CHANCE = 0.01
#: Noise of a channel that declares none, as a share of its largest reading, to judge that number.
USUAL_NOISE = 0.02
#: A sensor clips where its largest or smallest reading occurs at least so often, and so many times
#: as often as any other: a quantised sensor repeats its other readings as well.
CLIPPED_ROWS, CLIPPED_RATIO = 3, 3
#: Steps count where their standard deviation, q / sqrt(12), is at least this share of the noise:
#: less changes it by under 5 %. They are multiples of q to within this share of q, at least so many
#: readings, of so many values.
LEAST_STEP_NOISE, STEP_TOLERANCE, STEP_READINGS, STEP_LEVELS = 0.3, 1e-3, 6, 3
#: Rows from which two equal columns are copies of each other.
SAME_COLUMN_ROWS = 4
#: Rows from which a run that repeats another one exactly is a copy: fewer can agree by chance.
COPIED_ROWS = 3
#: Share of repeated rows from which the remark is a warning.
MANY = 0.2
_NAMES = ("source", "run", "status")  # Columns in which copies may differ
MOST_LINES = 8  # Rows that a remark names one by one


def sound_rows(case: Case, table: Table) -> tuple[Table, list[Remark]]:
    """The rows without what a sensor or logger spoilt, and remarks with rows and counts.

    Rows and runs that repeat others to the last digit are left out, whatever their times, and so
    are readings that a sensor held or clipped. Steps of a sensor that are coarser than its noise
    are added to its standard deviation.

    Raises `TableError` where two columns of measured values are the same.
    """
    channels = [column(n) for n in CHANNELS if column(n) in table]
    _check_copied_columns(table, channels)
    noise = {key: _noise(case, table, key) for key in channels}
    table, remarks = _without_repeated_rows(table, noise)
    for code, find in (("clipped-readings", _clipped), ("held-readings", _held)):
        for key in channels:
            spoilt, text = find(table, key, noise[key])
            if spoilt.any():
                sound = np.where(spoilt, np.nan, table[key])
                table = replace(table, columns={**table.columns, key: sound})
                remarks.append(_left_out(code, table, key, spoilt, text))
    for key in channels:
        table, remark = _with_noise_of_steps(case, table, key, noise[key])
        remarks += remark
    return table, remarks


def _noise(case: Case, table: Table, key: str) -> float:
    """Median declared standard deviation of a column, a usual one where none is declared."""
    std = declared_std(case, table, key)
    std = std[np.isfinite(std) & (std > 0.0)]
    if std.size:
        return float(np.median(std))
    return USUAL_NOISE * float(np.nanmax(np.abs(table[key]), initial=0.0))


def _resolution(values: Floats) -> float:
    """Step of which all values are multiples, from their smallest one; 0 where none is found.

    It is the smallest difference of two values or a whole part of it, as of a converter whose
    counts are scaled, else a decimal digit.
    """
    levels = np.unique(values[np.isfinite(values)])
    if levels.size < STEP_LEVELS:
        return 0.0
    from_first, largest = levels - levels[0], float(np.abs(levels).max())
    least = float(np.diff(levels).min())
    decimals = 10.0 ** np.arange(np.floor(np.log10(largest)), np.floor(np.log10(largest)) - 9, -1)
    for step in (*(least / np.arange(1, 9)), *decimals):
        multiples = from_first / step
        if np.abs(multiples - np.round(multiples)).max() <= STEP_TOLERANCE:
            return float(step)
    return 0.0


def _chance(values: Floats, noise: float) -> float:
    """Probability that two readings of one channel are equal by chance; 1 where few values tell."""
    if np.unique(values[np.isfinite(values)]).size < STEP_LEVELS:
        return 1.0
    step = _resolution(values)
    return min(1.0, step / (2.0 * np.sqrt(np.pi) * noise)) if noise > 0.0 else 1.0


def _check_copied_columns(table: Table, channels: list[str]) -> None:
    """Raise `TableError` where a measured column equals another one."""
    for one, other in combinations([*channels, *(n for n in ("slip", "load_N") if n in table)], 2):
        both = np.isfinite(table[one]) & np.isfinite(table[other])
        equal = both & (table[one] == table[other]) & (table[one] != 0.0)
        if equal.sum() >= SAME_COLUMN_ROWS and 2 * equal.sum() > both.sum():
            raise TableError(
                f"{table.source}: {one} and {other} are the same to the last digit in "
                f"{equal.sum()} of {both.sum()} rows; one of them is a copy: give its own column, "
                "or remove it"
            )


def _without_repeated_rows(table: Table, noise: dict[str, float]) -> tuple[Table, list[Remark]]:
    """The table without rows and runs that repeat earlier ones to the last digit."""
    names = [n for n in table.columns if n not in (*_NAMES, "time_s")]
    codes = np.stack([np.unique(table[n], return_inverse=True)[1] for n in names])
    _, row = np.unique(codes, axis=1, return_inverse=True)
    row = row.reshape(-1)
    own = table["run"] if "run" in table else np.zeros(len(table), dtype=np.int64)
    runs, first_of_run, run = np.unique(own, return_index=True, return_inverse=True)
    chance = float(np.prod([_chance(table[key], noise[key]) for key in noise])) if noise else 1.0
    kept, copied = np.ones(len(table), bool), list[str]()
    seen: dict[bytes, int] = {}
    for r in np.argsort(first_of_run):
        rows = np.flatnonzero(run == r)
        content, first = np.unique(row[rows], return_index=True)
        repeats = rows.size - content.size
        if repeats and chance * rows.size <= BY_CHANCE:
            kept[np.setdiff1d(rows, rows[first])] = False
        if content.size >= COPIED_ROWS and seen.setdefault(content.tobytes(), int(r)) != r:
            kept[rows] = False
            copied.append(str(runs[r]))
    count = int(np.count_nonzero(~kept))
    if not count:
        return table, []
    one = count == 1
    text = f"{'1 row repeats' if one else f'{count} rows repeat'} an earlier one to the last digit "
    text += f"and {'is' if one else 'are'} left out; {int(kept.sum())} rows are analysed"
    if copied:
        repeat = "repeats" if len(copied) == 1 else "repeat"
        text += f"; run{'s' * (len(copied) > 1)} {', '.join(copied)} {repeat} another run"
    severity: Severity = "warning" if count > MANY * len(table) else "note"
    return table.rows(kept), [Remark("duplicate-rows", text, tuple(copied), severity)]


def _clipped(table: Table, key: str, noise: float) -> tuple[Booleans, str]:
    """Readings of a column at an end of its range that a sensor or amplifier does not exceed.

    The range is that of all rows; also that of each run, as a gain may be set for it, where noise
    hardly makes equal readings.
    """
    groups, does = [np.ones(len(table), bool)], "clips"
    if "run" in table and _chance(table[key], noise) * len(table) <= BY_CHANCE:
        groups += [table["run"] == run for run in np.unique(table["run"])]
    spoilt, ends = np.zeros(len(table), bool), list[str]()
    for i, group in enumerate(groups):
        values = np.where(group, table[key], np.nan)
        levels, count = np.unique(values[np.isfinite(values)], return_counts=True)
        if levels.size <= CLIPPED_ROWS:
            continue
        for end, others in ((0, count[1:]), (-1, count[:-1])):
            if count[end] >= max(CLIPPED_ROWS, CLIPPED_RATIO * int(others.max()) + 1):
                if i > 0 and not spoilt[values == levels[end]].all():
                    does = "clips or holds"
                spoilt |= values == levels[end]
                ends.append(f"{levels[end]:.6g}")
    return spoilt, f"exactly {' or '.join(dict.fromkeys(ends))}: the sensor {does} there"


def _held(table: Table, key: str, noise: float) -> tuple[Booleans, str]:
    """Readings that repeat that of the row before, in the order of time within their run."""
    values, spoilt = table[key], np.zeros(len(table), bool)
    if _chance(values, noise) * len(table) > BY_CHANCE:
        return spoilt, ""
    run = table["run"] if "run" in table else np.zeros(len(table), dtype=np.int64)
    time = table["time_s"] if "time_s" in table else np.arange(len(table), dtype=np.float64)
    order = np.lexsort((time, np.unique(run, return_inverse=True)[1]))
    same_run = run[order[1:]] == run[order[:-1]]
    spoilt[order[1:]] = same_run & (values[order[1:]] == values[order[:-1]])
    text = "the same as in the row before, to the last digit: the sensor or logger repeated it"
    return spoilt, text


def _left_out(code: str, table: Table, key: str, spoilt: Booleans, text: str) -> Remark:
    """The remark on readings that are left out."""
    rows = np.flatnonzero(spoilt)
    named = ", ".join(str(table.line[i] if len(table.line) else i + 1) for i in rows[:MOST_LINES])
    where = f"{'lines' if len(table.line) else 'rows'} {named}"
    where += f" and {rows.size - MOST_LINES} more" if rows.size > MOST_LINES else ""
    are = "1 reading is" if rows.size == 1 else f"{rows.size} readings are"
    text = f"{key}: {are} left out ({where}), {text}"
    return Remark(code, text, (key,), "warning")


def _with_noise_of_steps(
    case: Case, table: Table, key: str, noise: float
) -> tuple[Table, list[Remark]]:
    """The table with the standard deviation of a sensor's steps in that of its readings."""
    values = table[key][np.isfinite(table[key])]
    step = _resolution(values)
    added = step / np.sqrt(12.0)
    declared = declared_std(case, table, key)
    if (
        values.size < STEP_READINGS
        or added < LEAST_STEP_NOISE * noise
        or not np.isfinite(declared).any()
    ):
        return table, []
    columns = {**table.columns, f"{key}_std": np.hypot(declared, added)}
    text = (
        f"{key} has steps of {step:.3g}, and its noise is {noise:.2g}: their standard deviation, "
        f"{added:.2g}, is added to it"
    )
    return replace(table, columns=columns), [Remark("coarse-steps", text, (key,), "note")]
