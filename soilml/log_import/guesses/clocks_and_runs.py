"""Which column is the clock of a log, what divides it into runs, which files make up one run."""

from __future__ import annotations

import glob
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from soilml.errors import InputError
from soilml.log_import.channels.runs import (
    alike_structs,
    files_by_run,
    key_words,
    matched_files,
    run_names,
    runs_of,
)
from soilml.log_import.guesses.columns import candidates_of, time_unit
from soilml.log_import.guesses.role_words import WHEEL_WORDS, name_scores, says
from soilml.log_import.mapping.log_map import FileKind, LogMap, RunsMap, TimeMap
from soilml.log_import.mapping.written_map import Marked, WrittenTable
from soilml.log_import.recording import Recording
from soilml.log_import.units import factor

_LEAST, _MOST_RUNS = 0.5, 1000  # Lowest score of a clock, and most runs of one file
_PAUSE = 5.0  # Shortest pause between two runs, s
#: Most wheels that take turns in one column, and share of lines that change it.
_MOST_WHEELS, _TURNS = 12, 0.2
_MOST = 400  # Most rows of a table that somebody has made of runs
Log = Sequence[Recording]


@dataclass
class Division:
    """What divides logs into runs, and their clocks; with the tables of the map that say it.

    labels: Of wheels that take turns in the lines of a log.
    """

    kinds: tuple[FileKind, ...] = ()
    time: TimeMap = field(default_factory=lambda: TimeMap(rate=100.0))
    runs: RunsMap = field(default_factory=RunsMap)
    labels: Sequence[str] = ()
    tables: list[WrittenTable] = field(default_factory=list)


def divide(logs: Sequence[Log], stated: Mapping[str, tuple[str, str]]) -> Division:
    """The clock of logs, and what divides them into runs.

    stated: Constants that the logs state, such as a `rate`.
    """
    found, log, runs = Division(), logs[0], WrittenTable("runs")
    if rows := _rows_that_are_runs(logs):
        found.runs = RunsMap(each_row=True)
        runs.put("each_row", True, f"{rows} rows and no time: each is a run")
        if name := _name_of_rows(log):
            runs.put("column", name, "rows with one name were driven on one soil")
        found.tables = [runs]
        return found
    column, labels, of_wheels = _label_column(log)
    first = [recording for log in logs[:4] for recording in log]
    found.labels = labels if of_wheels else ()
    clock, unit, why = _clock(first)
    if clock or any(recording.clock is not None for recording in first):
        found.time = TimeMap(clock, unit)
    elif "rate" in stated:
        found.time = TimeMap(rate=float(stated["rate"][0].split()[0]))
    structs = 0 if column else _structs_that_are_runs(log, clock)
    if column:
        found.runs = RunsMap(column)
        why_so = f"{len(labels)} values, one run each"
        if of_wheels:
            why_so = f"a line for each wheel ({', '.join(labels[:4])}): each is a run"
        runs.put("column", column, why_so)
    elif structs:
        found.runs = RunsMap(each_struct=True)
        runs.put("each_struct", True, f"{structs} with the same columns")
    else:
        again, count, pause = _restarts_and_pauses(log, clock, unit)
        found.runs = RunsMap(at_reset=again > 0, at_pause=pause)
        if again:
            runs.put("split_where_time_restarts", True, f"the time starts again {again} times")
        elif count:
            runs.put("split_at_pauses_over", f"{pause:g} s", f"the log pauses {count} times")
    if kinds := _file_kinds(logs):
        found.kinds = _with_clocks(logs, kinds, found)
    found.tables = [*map(_file_table, found.kinds), _time_table(found.time, why, "rate" in stated)]
    found.tables += [runs] if runs.keys else []
    return found


def _file_table(kind: FileKind) -> WrittenTable:
    table = WrittenTable(f"files.{kind.name}", {"pattern": kind.pattern})
    why = "times can be compared; 'start' where each clock starts at 0"
    if kind.clock == "start":
        why = "their clocks share no time: each starts at 0"
    table.put("clock", kind.clock, why)
    if kind.time_column:
        table.keys |= {"time": kind.time_column, "time_unit": kind.time_unit}
    return table


def _time_table(time: TimeMap, why: str, rate_is_stated: bool) -> WrittenTable:
    table = WrittenTable("time")
    if time.column:
        named = "time" in name_scores(time.column)
        doubt = "" if named else Marked("CHANGE: its name is of no time; it rises evenly")
        table.put("column", time.column, doubt)
        table.put("unit", time.unit, why)
    elif time.rate:
        why = "stated in the log" if rate_is_stated else Marked("CHANGE: no column is a clock")
        table.put("rate", f"{time.rate:g} Hz", why)
    else:
        return WrittenTable(before=["# Time comes from the messages."])
    return table


def _clock(recordings: Log) -> tuple[str, str, str]:
    """Column of time, its unit, and the comment on it; empty texts where there is none.

    The comment marks a unit that the log does not state and no size shows.
    """
    best = (_LEAST, "", "", "")
    for recording in recordings:
        for c in candidates_of([recording]) if recording.clock is None else ():
            if c.score("time") > best[0]:
                unit, clear = time_unit(recording.columns[c.name])
                why = "" if clear else Marked("CHANGE: not stated; by the size of its steps")
                unit, why = (c.unit, "") if c.kind == "s" else (unit, why)
                best = (c.score("time"), c.name, unit, why)
    return best[1:]


def _label_column(recordings: Log) -> tuple[str, list[str], bool]:
    """A column that names runs, or wheels that take turns; its labels, and whether of wheels.

    One of runs keeps its value for many lines, one of wheels changes it from line to line. An empty
    text where there is none.
    """
    for recording in recordings:
        numbers = {
            name: [f"{value:g}" for value in values]
            for name, values in recording.columns.items()
            if ("run" in name_scores(name) or (says(name, "wheel") and says(name, "numbered")))
            and np.all(values == np.round(values))
        }
        for name, cells in (recording.texts | numbers).items():
            labels = list(dict.fromkeys(cells))
            changes = sum(a != b for a, b in pairwise(cells))
            if not 1 < len(labels) <= _MOST_RUNS:
                continue
            if changes == len(labels) - 1 and len(labels) <= len(cells) / 20:
                return name, labels, False
            of_wheel = says(name, "wheel")
            sides = all(says(label, *WHEEL_WORDS) for label in labels)
            take_turns = len(labels) <= _MOST_WHEELS and changes > _TURNS * len(cells)
            if take_turns and "" not in labels and (sides or of_wheel):
                return name, labels, True
    return "", [], False


def _structs_that_are_runs(recordings: Log, clock: str) -> int:
    """How many structs of a file have the same columns and clock, and are not one for each wheel.

    `test_1`, `test_2` are runs; `front_left`, `front_right` and `wheel_1`, `wheel_2` are wheels.
    """
    alike = [recordings[i] for i in alike_structs(recordings)]
    if any(r.clock is not None or clock not in r.columns for r in alike):
        return 0
    return 0 if any(says(r.name, "places", "corners", "wheel") for r in alike) else len(alike)


def _restarts_and_pauses(recordings: Log, column: str, unit: str) -> tuple[int, int, float]:
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


def _file_kinds(logs: Sequence[Log]) -> tuple[FileKind, ...]:
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
    return _kinds_by(logs, members, words) or _kinds_by(logs, members, plain)


def _kinds_by(
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


def _with_clocks(
    logs: Sequence[Log], kinds: Sequence[FileKind], found: Division
) -> tuple[FileKind, ...]:
    """Kinds with their own columns of time, and with clocks that overlap."""
    members = next(iter(matched_files(logs, kinds).values()))
    named = []
    for kind in kinds:
        column, unit, _ = _clock([own for own, other in members if other is kind])
        alike = (column, unit) == (found.time.column, found.time.unit)
        named.append(kind if alike else replace(kind, time_column=column, time_unit=unit))
    log_map = LogMap("map", files=tuple(named), time=found.time, runs=found.runs)
    times = runs_of(logs, log_map)[0].times
    if max(own[0] for own in times) >= min(own[-1] for own in times):
        return tuple(replace(kind, clock="start") for kind in named)
    return tuple(named)


def _rows_that_are_runs(logs: Sequence[Log]) -> int:
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


def _name_of_rows(recordings: Log) -> str:
    """The column that names the run of each row; "" where none does."""
    names = [n for r in recordings for n in (*r.texts, *r.columns) if "run" in name_scores(n)]
    return next(iter([*names, *(name for r in recordings for name in r.texts)]), "")
