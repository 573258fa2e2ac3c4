"""Which column is the clock of a log, what divides it into runs, which files make up one run."""

from __future__ import annotations

import glob
import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from soilml.errors import InputError
from soilml.log_import.channels.runs import alike_structs, files_by_run, key_words, run_names
from soilml.log_import.guesses.behaviour import time_unit
from soilml.log_import.guesses.columns import WHEEL_WORDS, candidates_of, name_scores, words_of
from soilml.log_import.mapping.log_map import FileKind
from soilml.log_import.mapping.written_map import Marked
from soilml.log_import.recording import Recording
from soilml.log_import.units import factor

_LEAST, _MOST_RUNS = 0.5, 1000  # Lowest score of a clock, and most runs of one file
_PAUSE = 5.0  # Shortest pause between two runs, s
#: Words of a column of wheels, those of its number; most wheels, and share of lines that change it.
_OF_A_WHEEL = {"wheel", "wheels", "motor", "joint", "axle", "drive", "corner", "rad", "actuator"}
_NUMBERED = {"id", "no", "nr", "number", "index", "idx", "name", "wheel", "num"}
_MOST_WHEELS, _TURNS = 12, 0.2
Log = Sequence[Recording]
_SINCE_1970 = 5e8  # Seconds, and what is larger, of a clock that counts from 1970
_MOST = 400  # Most rows of a table that somebody has made of runs


def guess_clock(recordings: Sequence[Recording]) -> tuple[str, str]:
    """Column of time and its unit; two empty texts where there is none."""
    best = (_LEAST, "", "")
    for recording in recordings:
        if recording.clock is not None:
            continue
        for candidate in candidates_of([recording]):
            score = candidate.scores.get("time", 0.0)
            if score > best[0]:
                unit = candidate.unit if candidate.kind == "s" else ""
                values = recording.columns[candidate.name]
                best = (score, candidate.name, unit or time_unit(values))
    return best[1], best[2]


def why_time_unit(recordings: Sequence[Recording], column: str, unit: str) -> str:
    """The comment of a unit of time: a mark where the log does not state it, and no size shows it.

    Clocks since 1970, days of spreadsheets and seconds with steps below one are clear.
    """
    for recording in recordings:
        if column not in recording.columns or recording.clock is not None:
            continue
        own = next(c for c in candidates_of([recording]) if c.name == column)
        values = recording.columns[column]
        steps = np.diff(values[np.isfinite(values)])
        clear = abs(own.about.low) > _SINCE_1970 or unit == "d"
        if own.kind == "s" or clear or (unit == "s" and float(np.median(steps)) < 1.0):
            return ""
        return Marked("CHANGE: not stated; by the size of its steps")
    return ""


def guess_run_column(recordings: Sequence[Recording]) -> tuple[str, int]:
    """A column whose value names the run, and how many there are; "" where no column does."""
    for recording in recordings:
        columns = dict(recording.texts)
        for name, values in recording.columns.items():
            if "run" in name_scores(name) and np.isfinite(values).all():
                columns[name] = [f"{value:g}" for value in values]
        for name, cells in columns.items():
            count = len(set(cells))
            changes = sum(a != b for a, b in pairwise(cells))
            if 1 < count <= min(_MOST_RUNS, len(cells) / 20) and changes == count - 1:
                return name, count
    return "", 0


def guess_wheel_column(recordings: Sequence[Recording]) -> tuple[str, list[str]]:
    """A column that says of which wheel a line is, and its wheels; "" and [] where none does.

    Its value changes from line to line, as the wheels take turns.
    """
    for recording in recordings:
        columns = dict(recording.texts)
        for name, values in recording.columns.items():
            whole = np.isfinite(values).all() and np.all(values == np.round(values))
            if whole and _OF_A_WHEEL & {*words_of(name)} and _NUMBERED & {*words_of(name)}:
                columns[name] = [f"{value:g}" for value in values]
        for name, cells in columns.items():
            labels = list(dict.fromkeys(cells))
            if not 1 < len(labels) <= _MOST_WHEELS or "" in labels:
                continue
            sides = all({*words_of(label)} & {*WHEEL_WORDS} for label in labels)
            changes = sum(a != b for a, b in pairwise(cells))
            if changes > _TURNS * len(cells) and (sides or _OF_A_WHEEL & {*words_of(name)}):
                return name, labels
    return "", []


def lines_of_first(recordings: Sequence[Recording], column: str) -> list[Recording]:
    """The recordings with the lines of one label alone, where they have this column."""
    found = []
    for recording in recordings:
        cells = recording.texts.get(column) or recording.columns.get(column)
        keep = np.ones(0, dtype=bool) if cells is None else np.asarray(cells) == cells[0]
        found.append(recording.rows(keep) if keep.size else recording)
    return found


def structs_are_runs(recordings: Sequence[Recording], clock: str) -> int:
    """How many structs of a file have the same columns and clock, and are not one for each wheel.

    `test_1`, `test_2` are runs; `front_left`, `front_right` and `wheel_1`, `wheel_2` are wheels.
    """
    alike = [recordings[i] for i in alike_structs(recordings)]
    if not alike or any(r.clock is not None or clock not in r.columns for r in alike):
        return 0
    words = {word for r in alike for word in words_of(r.name)}
    sides = {word for word in words if word in WHEEL_WORDS and not word.isdigit()}
    return 0 if sides or words & {"wheel", "motor", "drive", "axle"} else len(alike)


def restarts(recordings: Sequence[Recording], column: str) -> int:
    """How often the clock starts again from its beginning."""
    for recording in recordings:
        if column in recording.columns:
            values = recording.columns[column]
            values = values[np.isfinite(values)]
            steps = np.diff(values)
            back = steps < -0.2 * np.nanmax(np.abs(values - values[0]))
            return int(back.sum()) if back.sum() == np.sum(steps < 0.0) else 0
    return 0


def pauses(recordings: Sequence[Recording], column: str, unit: str) -> tuple[int, float]:
    """How often a log pauses between runs, and a length below that of these pauses, s.

    Pauses are at least 5 s and 100 samples long. Without one, 0 and infinity.
    """
    for recording in recordings:
        if column in recording.columns:
            steps = np.diff(recording.columns[column]) * factor(unit, "s", "[time] unit")
            usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else math.inf
            long = steps[steps > max(_PAUSE, 100.0 * usual)]
            if 0 < long.size < _MOST_RUNS:
                return int(long.size), float(f"{0.8 * float(np.min(long)):.2g}")
    return 0, math.inf


def refuse_a_table_of_runs(log: Sequence[Recording]) -> None:
    """Raise `InputError` for a table whose rows are means already."""
    for recording in log:
        held = {*recording.columns, *recording.texts}
        if {"run", "slip", "load_N"} <= held and not {"time", "t"} & held:
            raise InputError(
                f"{recording.file} is a table of runs already, with one row for each operating "
                "point: give it to `soilml identify`, `estimate` or `gap` as it is"
            )


def guess_file_kinds(logs: Sequence[Log]) -> tuple[FileKind, ...]:
    """Kinds of files with different columns that have one run in common; empty for one kind.

    The words that the names of all files of a kind share, and not those of all kinds, are its
    pattern; where there are none, their words without a number at the end.
    """
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, log in enumerate(logs):
        signature = tuple((r.name, *sorted((*r.columns, *r.texts))) for r in log)
        groups.setdefault(signature, []).append(i)
    if len(groups) < 2:
        return ()
    names = run_names([log[0].file for log in logs])
    words = [key_words(name, set()) for name in names]
    plain = [[word.rstrip("0123456789") or word for word in own] for own in words]
    return _kinds_of(logs, groups, words) or _kinds_of(logs, groups, plain)


def _kinds_of(
    logs: Sequence[Log], groups: dict[tuple[object, ...], list[int]], words: list[list[str]]
) -> tuple[FileKind, ...]:
    """The kinds by the words of their names; empty where these do not tell them."""
    shared = [set.intersection(*({*words[i]} for i in members)) for members in groups.values()]
    of_all = set.intersection(*shared)
    kinds = []
    for members, common in zip(groups.values(), shared, strict=True):
        # in their order, with those that two kinds share: what is left says which run it is
        own = [w for w in dict.fromkeys(words[members[0]]) if w in common - of_all]
        others = [{*words[i]} for i in range(len(logs)) if i not in members]
        if not own or any({*own} <= other for other in others):
            return ()
        # a dot in the name of a table of TOML would begin another one
        name = "_".join(own).replace(".", "_")
        kinds.append(FileKind(name, "*".join(["", *map(glob.escape, own), ""])))
    try:
        runs = files_by_run(logs, kinds)
    except InputError:
        return ()
    whole = [len({id(kind) for _, kind in own}) == len(kinds) for own in runs.values()]
    return tuple(kinds) if any(whole) else ()


def clocks_differ(clocks: Sequence[tuple[float, float]]) -> bool:
    """Whether the ranges of time (from, until) of the kinds do not overlap."""
    return max(start for start, _ in clocks) >= min(stop for _, stop in clocks)


def rows_are_runs(logs: Sequence[Sequence[Recording]]) -> int:
    """How many rows the tables have, where each row is a steady run; 0 for logs over time.

    Such tables are short and have no column whose name or unit is a time.
    """
    count = 0
    for log in logs:
        for recording in log:
            if recording.clock is not None or not 0 < len(recording) <= _MOST:
                return 0
            if any(line for line in recording.about if "rate" in line.lower()):
                return 0
            if any("time" in name_scores(name) for name in recording.texts):
                return 0
            for c in candidates_of([recording]):
                # the torque T is no time, and a number of the row has no name of one
                if c.kind == "s" or ("time" in c.scores and "time" in name_scores(c.name)):
                    return 0
            count += len(recording)
    return count


def run_of_rows(recordings: Sequence[Recording]) -> str:
    """The column that names the run of each row; "" where none does."""
    for recording in recordings:
        for name in (*recording.texts, *recording.columns):
            if "run" in name_scores(name):
                return name
        for name in recording.texts:
            return name
    return ""
