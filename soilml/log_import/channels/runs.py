"""Which recordings belong to one run, and their common clock."""

from __future__ import annotations

import difflib
import fnmatch
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.io.spreadsheet import split_sheet
from soilml.log_import.mapping.log_map import FileKind, LogMap
from soilml.log_import.recording import Recording
from soilml.log_import.units import factor
from soilml.remarks import Remark

#: A recording, and the kind of its file where a run has several kinds.
Member = tuple[Recording, FileKind | None]
_WORDS = re.compile(r"[^A-Za-z0-9.]+|(?<=[a-z0-9])(?=[A-Z])")
#: Fewest different seconds, and share of the seconds that must have several lines.
_FEWEST, _SEVERAL = 5, 0.8


@dataclass(frozen=True)
class Run:
    """One drive: its recordings, with the time of their samples in s after the run's start."""

    name: str
    recordings: tuple[Recording, ...]
    times: tuple[Floats, ...]
    notes: tuple[Remark, ...] = ()

    @property
    def about(self) -> tuple[str, ...]:
        """What its files state before their samples, line by line."""
        return tuple(dict.fromkeys(line for own in self.recordings for line in own.about))

    def find(self, address: str) -> tuple[Floats, Floats]:
        """Times and samples of a column, `NAME` or `RECORDING:NAME`.

        Raises `InputError` where no recording has it, or several have.
        """
        holds = [
            (recording, times, column)
            for recording, times in zip(self.recordings, self.times, strict=True)
            if (column := _column_in(recording, address))
        ]
        if len(holds) > 1:
            options = ", ".join(f"'{r.name}:{c}'" for r, _, c in holds)
            raise InputError(f"run {self.name}: several recordings have the column {address!r}; "
                             f"needed is one of {options}")  # fmt: skip
        if not holds:
            raise InputError(f"run {self.name}: {_missing(self.recordings, address)}")
        recording, times, column = holds[0]
        return times, recording.columns[column]


def _column_in(recording: Recording, address: str) -> str:
    """Name of the column of a recording that an address means; "" where it has none."""
    names = [address, *([address.removeprefix(f"{recording.name}:")] if recording.name else [])]
    return next((name for name in names if name in recording.columns), "")


def _missing(recordings: Sequence[Recording], address: str) -> str:
    known = [f"{r.name}:{c}" if r.name else c for r in recordings for c in r.columns]
    texts = [c for r in recordings for c in r.texts]
    if address in texts:
        return f"the column {address!r} holds text; needed are numbers"
    near = difflib.get_close_matches(address, known, 1, 0.5)
    hint = f"did you mean {near[0]!r}?" if near else f"there are: {', '.join(known[:20])}"
    return f"no column {address!r}; {hint}"


def runs_of(logs: Sequence[Sequence[Recording]], log_map: LogMap) -> list[Run]:
    """The runs of logs: one for each file, for each set of files that belong together, or for each
    value of the run column.

    Raises `InputError` where files cannot be matched, or time is missing.
    """
    found = [
        (name, label, part)
        for name, members in matched_files(logs, log_map.files).items()
        for label, part in _divided(name, members, log_map)
    ]
    labels = [label for _, label, _ in found]
    # several files may number their runs alike
    return [
        _with_times(label if labels.count(label) == 1 else f"{name}_{label}", part, log_map)
        for name, label, part in found
    ]


def _labels(recordings: Sequence[Recording], column: str) -> tuple[int, list[str]]:
    """Which recording has the column of runs, and its cells; raises `InputError` for none."""
    at = [i for i, r in enumerate(recordings) if column in r.texts or column in r.columns]
    if len(at) != 1:
        raise InputError(f"[runs] column: {_missing(recordings, column)}")
    own = recordings[at[0]]
    cells = own.texts.get(column) or [f"{value:g}" for value in own.columns[column]]
    return at[0], [cell or "unnamed" for cell in cells]


def runs_of_rows(logs: Sequence[Sequence[Recording]], log_map: LogMap) -> list[Run]:
    """Tables whose rows are steady runs, as runs of rows with one name that follow each other.

    The name is that of the column of [runs], or of the file; the time of a row is its number.
    """
    runs, key = [], log_map.runs.column
    for name, log in zip(run_names([log[0].file for log in logs]), logs, strict=True):
        for recording in log:
            labels = _labels([recording], key)[1] if key else [name] * len(recording)
            number = np.arange(float(len(recording)))
            starts = [i for i, label in enumerate(labels) if i == 0 or label != labels[i - 1]]
            for start, stop in pairwise([*starts, len(labels)]):
                keep = (number >= start) & (number < stop)
                runs.append(Run(labels[start], (recording.rows(keep),), (number[keep],)))
    return runs


def matched_files(
    logs: Sequence[Sequence[Recording]], kinds: Sequence[FileKind]
) -> dict[str, list[Member]]:
    """Recordings by the name of their run, with the kind of their file.

    Raises `InputError` where the name of a file has no pattern, and where a run lacks a kind.
    """
    found = files_by_run(logs, kinds)
    for key, members in found.items():
        there = [kind.name for _, kind in members if kind is not None]
        lacking = [kind.name for kind in kinds if kind.name not in there]
        if lacking:
            raise InputError(
                f"run {key}: no file of the kind {lacking[0]!r}; there is "
                f"{', '.join(str(recording.file) for recording, _ in members)}; give it, or leave "
                "out the others of this run"
            )
    return found


def files_by_run(
    logs: Sequence[Sequence[Recording]], kinds: Sequence[FileKind]
) -> dict[str, list[Member]]:
    """Recordings by the name of their run, of which some may lack a kind of file."""
    files = [log[0].file for log in logs]
    found: dict[str, list[Member]] = {}
    for file, name, log in zip(files, run_names(files), logs, strict=True):
        if not kinds:
            found[name] = [(recording, None) for recording in log]
            continue
        matching = [k for k in kinds if fnmatch.filter((name, file.name), k.pattern)]
        if len(matching) != 1:
            known = ", ".join(f"{k.name} = {k.pattern!r}" for k in kinds)
            raise InputError(
                f"{file}: {len(matching)} patterns of [files] fit its name; needed is one: {known}"
            )
        key = "_".join(key_words(name, set(_words(matching[0].pattern)))) or "run"
        for recording in log:
            own = matching[0].name + (f"/{recording.name}" if recording.name else "")
            found.setdefault(key, []).append((replace(recording, name=own), matching[0]))
    return found


def run_names(files: Sequence[Path]) -> list[str]:
    """A name for each file: its stem, with folders where several files have the same one.

    The name of a sheet of a spreadsheet stands behind that of its file.
    """
    stems = [
        "_".join(filter(None, (own.stem if own.suffix else own.name, sheet)))
        for own, sheet in map(split_sheet, files)
    ]
    for depth in range(7):
        folders = [file.parts[:-1][-depth:] if depth else () for file in files]
        names = ["_".join((*own, stem)) for own, stem in zip(folders, stems, strict=True)]
        if len(set(names)) == len(names):
            break
    return names


def _words(text: str) -> list[str]:
    return [word for word in _WORDS.split(text) if word.strip(".")]


def key_words(name: str, without: set[str]) -> list[str]:
    """The words of a run's name that say which run, without those that say which kind of file.

    Of a kind with a number, as in `wheel3`, the number is left.
    """
    left = []
    for word in _words(name):
        kind = word if word in without else word.rstrip("0123456789")
        left.append(word.removeprefix(kind) if kind in without else word)
    return [word for word in left if word]


def _with_times(name: str, members: list[Member], log_map: LogMap) -> Run:
    recordings, clocks, notes = [], [], []
    for recording, kind in members:
        clock = _clock(recording, log_map, kind)
        if clock is None:
            continue
        spread = spread_over_seconds(clock)
        if spread is not clock:
            text = "the clock shows whole seconds: lines of one second are spread over it"
            notes.append(Remark("whole-seconds", text, severity="note"))
        # samples whose time is above that of all before
        filled = np.where(np.isfinite(spread), spread, -np.inf)
        good = filled > np.maximum.accumulate(np.concatenate([[-np.inf], filled[:-1]]))
        if not good.any():
            continue
        if not good.all():
            text = f"{int(np.sum(~good))} samples go back in time or have none, and are left out"
            notes.append(Remark("times-not-increasing", text))
            recording = recording.rows(good)
        clock, same = spread[good], kind is None or kind.clock == "same"
        recordings.append(recording)
        clocks.append((clock - (0.0 if same else clock[0]) + (kind.delay if kind else 0.0), same))
        notes += recording.notes
    if not clocks:
        raise InputError(
            f"run {name}: no recording has a time; needed is [time] column, or [time] rate = "
            "'100 Hz'"
        )
    common = [clock[0] for clock, same in clocks if same]
    divided = log_map.runs.column or log_map.runs.by_time
    start = (common[0] if divided else min(common)) if common else 0.0
    times = tuple(clock - start if same else clock for clock, same in clocks)
    return Run(name, tuple(recordings), times, tuple(dict.fromkeys(notes)))


def _clock(recording: Recording, log_map: LogMap, kind: FileKind | None) -> Floats | None:
    """Time of the samples in s; None where the recording has no time."""
    name = (kind.time_column if kind else "") or log_map.time.column
    if name and (column := _column_in(recording, name)):
        unit = (kind.time_unit if kind else "") or log_map.time.unit
        return recording.columns[column] * factor(unit, "s", "[time] unit")
    if name in recording.texts:
        raise InputError(
            f"{recording.file}: the time in column {name!r} is not understood: "
            f"{recording.texts[name][0]!r}; needed are numbers, dates, hh:mm:ss"
        )
    if recording.clock is None and log_map.time.rate:
        return np.arange(len(recording)) / log_map.time.rate
    return recording.clock


def alike_structs(recordings: Sequence[Recording]) -> list[int]:
    """Places of the recordings of a file that have the same columns as others; most of a kind."""
    kinds: dict[frozenset[str], list[int]] = {}
    for i, recording in enumerate(recordings):
        if recording.name:
            kinds.setdefault(frozenset(recording.columns), []).append(i)
    most = max(kinds.values(), key=len, default=[])
    return most if len(most) > 1 else []


def _divided(
    name: str, members: Sequence[Member], log_map: LogMap
) -> list[tuple[str, list[Member]]]:
    """A log as its runs: by the run column, where its time starts again, or where it pauses.

    Recordings without the column take part in every run, where they overlap in time.
    """
    at = 0
    recordings = [recording for recording, _ in members]
    if log_map.runs.column:
        at, labels = _labels(recordings, log_map.runs.column)
    elif log_map.runs.each_struct:
        alike = alike_structs(recordings)
        if not alike:
            raise InputError(
                f"[runs] each_struct: {members[0][0].file} has no two structs with the same columns"
            )
        shared = [m for i, m in enumerate(members) if i not in alike]
        return [
            (f"{name}_{members[i][0].name.rpartition('.')[2]}", [members[i], *shared])
            for i in alike
        ]
    elif log_map.runs.by_time:
        clock = _clock(members[0][0], log_map, members[0][1])
        steps = np.diff(np.zeros(len(recordings[0])) if clock is None else clock)
        ends = (steps < 0.0) & log_map.runs.at_reset | (steps > log_map.runs.at_pause)
        labels = [f"{name}_{part + 1:02d}" for part in np.concatenate([[0], np.cumsum(ends)])]
    else:
        return [(name, list(members))]
    found, every = [], np.asarray(labels)
    for label in dict.fromkeys(labels):
        part = list(members)
        # the recording that was divided comes first: its start is that of the run
        whole, kind = part.pop(at)
        found.append((label, [(whole.rows(every == label), kind), *part]))
    return found


def spread_over_seconds(clock: Floats) -> Floats:
    """Time (n,) in s with the lines of each second evenly over it; `clock` itself where it has
    fractions, or one line a second.

    The first second may have begun before the log, and the last one ends after it: these have the
    step of the others.
    """
    known = np.flatnonzero(np.isfinite(clock))
    own = clock[known]
    if own.size == 0 or np.any(own != np.round(own)) or np.any(np.diff(own) < 0.0):
        return clock
    seconds, first, count = np.unique(own, return_index=True, return_counts=True)
    if seconds.size < _FEWEST or np.mean(count[1:-1] > 1) < _SEVERAL:
        return clock
    lines = count.astype(np.float64)
    lines[[0, -1]] = np.maximum(lines[[0, -1]], np.median(count[1:-1]))
    late = np.where(np.arange(seconds.size) == 0, lines - count, 0.0)
    place = np.arange(own.size) - np.repeat(first - late, count)
    spread = clock.copy()
    spread[known] = own + place / np.repeat(lines, count)
    return spread
