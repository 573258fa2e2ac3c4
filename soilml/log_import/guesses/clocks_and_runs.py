"""Which column is the clock of a log, what divides it into runs, which files make up one run."""

from __future__ import annotations

import glob
import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from soilml.errors import InputError
from soilml.log_import.channels.runs import alike_structs, files_by_run, key_words, run_names
from soilml.log_import.guesses.behaviour import time_unit
from soilml.log_import.guesses.columns import (
    WHEEL_WORDS,
    candidates_of,
    name_scores,
    says,
)
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
_SINCE_1970 = 5e8  # Seconds, and what is larger, of a clock that counts from 1970
_MOST = 400  # Most rows of a table that somebody has made of runs
Log = Sequence[Recording]


def guess_clock(recordings: Log) -> tuple[str, str, str]:
    """Column of time, its unit, and the comment on it; empty texts where there is none.

    The comment marks a unit that the log does not state and no size shows: clocks since 1970, days
    of spreadsheets and seconds with steps below one are clear.
    """
    best = (_LEAST, "", "", "")
    for recording in recordings:
        for c in candidates_of([recording]) if recording.clock is None else ():
            score = c.scores.get("time", 0.0)
            if score > best[0]:
                values = recording.columns[c.name]
                unit = c.unit if c.kind == "s" and c.unit else time_unit(values)
                step = float(np.median(np.diff(values[np.isfinite(values)])))
                clear = abs(c.about.low) > _SINCE_1970 or unit == "d" or (unit == "s" and step < 1)
                why = "CHANGE: not stated; by the size of its steps"
                best = (score, c.name, unit, "" if c.kind == "s" or clear else Marked(why))
    return best[1:]


def _labels(recording: Recording, numbers_too: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Columns of text, and of some numbers as texts."""
    yield from recording.texts.items()
    for name in numbers_too:
        if np.isfinite(recording.columns[name]).all():
            yield name, [f"{value:g}" for value in recording.columns[name]]


def guess_run_column(recordings: Log) -> tuple[str, int]:
    """A column whose value names the run, and how many there are; "" where no column does."""
    for recording in recordings:
        named = [name for name in recording.columns if "run" in name_scores(name)]
        for name, cells in _labels(recording, named):
            count = len(set(cells))
            changes = sum(a != b for a, b in pairwise(cells))
            if 1 < count <= min(_MOST_RUNS, len(cells) / 20) and changes == count - 1:
                return name, count
    return "", 0


def guess_wheel_column(recordings: Log) -> tuple[str, list[str]]:
    """A column that says of which wheel a line is, and its wheels; "" and [] where none does.

    Its value changes from line to line, as the wheels take turns.
    """
    for recording in recordings:
        numbers = [
            name for name, values in recording.columns.items()
            if says(name, _OF_A_WHEEL) and says(name, _NUMBERED)
            and np.all(values == np.round(values))
        ]  # fmt: skip
        for name, cells in _labels(recording, numbers):
            labels = list(dict.fromkeys(cells))
            if 1 < len(labels) <= _MOST_WHEELS and "" not in labels:
                sides = all(says(label, WHEEL_WORDS) for label in labels)
                changes = sum(a != b for a, b in pairwise(cells))
                if changes > _TURNS * len(cells) and (sides or says(name, _OF_A_WHEEL)):
                    return name, labels
    return "", []


def lines_of_first(recordings: Log, column: str) -> list[Recording]:
    """The recordings with the lines of one label alone, where they have this column."""
    found = []
    for recording in recordings:
        cells = np.asarray(recording.texts.get(column) or recording.columns.get(column, []))
        found.append(recording.rows(cells == cells[0]) if cells.size else recording)
    return found


def structs_are_runs(recordings: Log, clock: str) -> int:
    """How many structs of a file have the same columns and clock, and are not one for each wheel.

    `test_1`, `test_2` are runs; `front_left`, `front_right` and `wheel_1`, `wheel_2` are wheels.
    """
    alike = [recordings[i] for i in alike_structs(recordings)]
    if any(r.clock is not None or clock not in r.columns for r in alike):
        return 0
    of_wheels = {w for w in WHEEL_WORDS if not w.isdigit()} | {"wheel", "motor", "drive", "axle"}
    return 0 if any(says(r.name, of_wheels) for r in alike) else len(alike)


def restarts_and_pauses(recordings: Log, column: str, unit: str) -> tuple[int, int, float]:
    """How often the clock starts again from its beginning, and how often a log pauses between runs;
    with a length below that of these pauses, s, infinite without one.

    Pauses are at least 5 s and 100 samples long.
    """
    for recording in recordings:
        if column in recording.columns:
            values = recording.columns[column]
            values = values[np.isfinite(values)]
            steps = np.diff(values)
            back = int(np.sum(steps < -0.2 * np.max(np.abs(values - values[0]))))
            steps = steps * factor(unit, "s", "[time] unit")
            usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else math.inf
            long = steps[steps > max(_PAUSE, 100.0 * usual)]
            some = 0 < long.size < _MOST_RUNS
            length = float(f"{0.8 * float(np.min(long)):.2g}") if some else math.inf
            return back if back == np.sum(steps < 0.0) else 0, long.size if some else 0, length
    return 0, 0, math.inf


def refuse_a_table_of_runs(log: Log) -> None:
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
    words = [key_words(name, set()) for name in run_names([log[0].file for log in logs])]
    plain = [[word.rstrip("0123456789") or word for word in own] for own in words]
    members = list(groups.values())
    return _kinds_of(logs, members, words) or _kinds_of(logs, members, plain)


def _kinds_of(
    logs: Sequence[Log], groups: list[list[int]], words: list[list[str]]
) -> tuple[FileKind, ...]:
    """The kinds by the words of their names; empty where these do not tell them."""
    shared = [set.intersection(*({*words[i]} for i in members)) for members in groups]
    of_all = set.intersection(*shared)
    kinds = []
    for members, common in zip(groups, shared, strict=True):
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


def rows_are_runs(logs: Sequence[Log]) -> int:
    """How many rows the tables have, where each row is a steady run; 0 for logs over time.

    Such tables are short and have no column whose name or unit is a time.
    """
    recordings = [recording for log in logs for recording in log]
    for recording in recordings:
        timed = recording.clock is not None or not 0 < len(recording) <= _MOST
        timed |= any("rate" in line.lower() for line in recording.about)
        timed |= any("time" in name_scores(name) for name in recording.texts)
        # the torque T is no time, and a number of the row has no name of one
        if timed or any(
            c.kind == "s" or ("time" in c.scores and "time" in name_scores(c.name))
            for c in candidates_of([recording])
        ):
            return 0
    return sum(map(len, recordings))


def run_of_rows(recordings: Log) -> str:
    """The column that names the run of each row; "" where none does."""
    names = [n for r in recordings for n in (*r.texts, *r.columns) if "run" in name_scores(n)]
    return next(iter([*names, *(name for r in recordings for name in r.texts)]), "")
