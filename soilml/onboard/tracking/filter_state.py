"""State of a tracker: rows in question, readings that repeat, and the window remembered."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.onboard.memory import Memory
from soilml.onboard.set_contract import ABSENT_STD, OPERATING_NOISE, OPTIONAL_READINGS
from soilml.onboard.state_checksum import state_checksum
from soilml.onboard.tracking.misfit import ROWS_JUDGED, Rows
from soilml.onboard.tracking.row_window import LEAST_ROWS, RecentRows, RowWindow, join

MOST_ROWS = 8  # Rows after which one that disagreed is a glitch
#: Rows in succession that disagree with those before, after which these are given up even if the
#: new ones do not agree with each other.
GIVE_UP_AFTER = 25
#: Sensors that can be found stuck: those of torque, sinkage and pull, and those of slip and load
#: where they have noise and have changed in `ALIVE_AFTER` rows in succession. Otherwise they may be
#: set, and constant by intention.
WATCHED = ("torque", *OPTIONAL_READINGS, *OPERATING_NOISE)
#: Exact repetitions in succession after which a sensor is stuck.
REPETITIONS = 2
#: Rows in succession, each with another reading than the row before, after which a slip or load is
#: known to be a sensor's. A glitch or two in a load that is set are fewer.
ALIVE_AFTER = 8
Arrays = dict[str, NDArray[Any]]

FORMAT = 4  # Version of the arrays
CHECKSUM = "checksum"  # Name of the array that has the checksum of the others


@dataclass(frozen=True)
class RowsInQuestion:
    """The last rows since the first of them that disagreed with those before.

    rows: At most `MOST_ROWS` rows.
    disagree: Whether each of them disagrees; the first does.
    in_succession: Rows without one that agrees, up to now.
    """

    rows: tuple[Rows, ...] = ()
    disagree: tuple[bool, ...] = ()
    in_succession: int = 0

    @property
    def count(self) -> int:
        """Rows that disagree."""
        return sum(self.disagree)

    def with_row(self, row: Rows, disagrees: bool) -> RowsInQuestion:
        """These rows and another one."""
        rows, flags = (*self.rows, row)[-MOST_ROWS:], (*self.disagree, disagrees)[-MOST_ROWS:]
        first = flags.index(True) if any(flags) else len(flags)
        return RowsInQuestion(
            rows[first:], flags[first:], self.in_succession + 1 if disagrees else 0
        )

    def without_reading(self, name: str, value: float) -> RowsInQuestion:
        """These rows without those of one reading, which proved to be stuck."""
        found = RowsInQuestion()
        for row, disagrees in zip(self.rows, self.disagree, strict=True):
            if row[name][0] != value:
                found = found.with_row(row, disagrees)
        return found

    def candidates(self) -> list[Rows]:
        """Rows (m,) that may be the first of another soil: all, and the last ones.

        The last ones are those since the last row that agreed with the rows before, as rows of
        another soil do at some slips and loads.
        """
        if self.count < LEAST_ROWS:
            return []
        last = min(self.in_succession, len(self.rows))
        if last == len(self.rows):
            last = LEAST_ROWS
        lengths = {len(self.rows), last} if last >= LEAST_ROWS else {len(self.rows)}
        return [joined(self.rows[-n:]) for n in sorted(lengths, reverse=True)]


def joined(rows: Sequence[Rows]) -> Rows:
    """Several rows as one set of row inputs."""
    return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}


@dataclass(frozen=True)
class RepeatedReadings:
    """The row before, and how often each watched reading was repeated in succession.

    times: Repetitions in succession of each of `WATCHED`.
    changes: Rows in succession that changed it; once `ALIVE_AFTER`, so for good.
    """

    previous: Rows | None = None
    times: tuple[int, ...] = (0,) * len(WATCHED)
    changes: tuple[int, ...] = (0,) * len(WATCHED)

    def repeats(self, row: Rows) -> bool:
        """Whether a row is the row before once more."""
        before = self.previous
        return before is not None and all(
            row[n][0] == before[n][0] for n in ("slip", "load", *WATCHED)
        )

    def with_row(self, row: Rows) -> RepeatedReadings:
        """The counts after another row."""
        before = self.previous
        if before is None:
            return RepeatedReadings(row)
        # a wheel that stands repeats its slip and torque, whatever the load does
        if not (row["slip"][0] or row["torque"][0]):
            return RepeatedReadings(row, changes=self.changes)
        equal = [bool(row[n][0] == before[n][0]) for n in WATCHED]
        return RepeatedReadings(
            row,
            tuple(
                min(times + 1, REPETITIONS) if same and _measured(row, n) else 0
                for n, times, same in zip(WATCHED, self.times, equal, strict=True)
            ),
            tuple(
                count if count == ALIVE_AFTER else 0 if same else count + 1
                for count, same in zip(self.changes, equal, strict=True)
            ),
        )

    @property
    def stuck(self) -> str | None:
        """The first sensor that is stuck."""
        for name, times, changes in zip(WATCHED, self.times, self.changes, strict=True):
            alive = changes == ALIVE_AFTER or name not in OPERATING_NOISE
            if times == REPETITIONS and alive:
                return name
        return None


def _measured(row: Rows, name: str) -> bool:
    std = float(row[f"{name}_std"][0]) if f"{name}_std" in row else 0.0
    return 0.0 < std < ABSENT_STD


@dataclass(frozen=True)
class FilterState:
    """State of a tracker after a row.

    window: The rows that the estimate rests on.
    question: Rows that may be of another soil.
    repeated: Which readings repeat.
    increases: What each of the last rows added to the misfit, over its median for sound rows.
    rows_since_change: Rows used since the soil changed.
    rows_since_drift: Rows used since a drift was last found; -1: never, on this soil.
    variance: Variance of the noise that the rows show, over that stated, 1 or more.
    """

    window: RowWindow
    question: RowsInQuestion = field(default_factory=RowsInQuestion)
    repeated: RepeatedReadings = field(default_factory=RepeatedReadings)
    increases: tuple[float, ...] = ()
    rows_since_change: int = 0
    rows_since_drift: int = -1
    variance: float = 1.0

    def with_increase(self, value: float) -> FilterState:
        """The state after a row that added so much to the misfit, over its median."""
        return replace(self, increases=(*self.increases, value)[-ROWS_JUDGED:])

    def of_another_soil(self, window: RowWindow) -> FilterState:
        """The state with rows of another soil alone; the size of the model error is kept."""
        kept = len(self.increases) - len(self.question.rows)
        return FilterState(
            window,
            repeated=self.repeated,
            increases=self.increases[: max(kept, 0)],
            rows_since_change=window.memory.rows,
            variance=self.variance,
        )

    def as_arrays(self, identity: str) -> Arrays:
        """Everything as arrays of numbers and text, for `numpy.savez`."""
        blocks = self.window.blocks
        empty = self.window.memory.system[:0]
        previous = [] if self.repeated.previous is None else [self.repeated.previous]
        rows = [*previous, *self.question.rows]
        recent = self.window.recent
        read = [row for one in recent for row in _one_by_one(one.rows)]
        names = list((rows or read or [{}])[0])
        arrays = {
            "format": np.asarray(FORMAT),
            "model": np.asarray(identity),
            "system": np.concatenate([empty, *(block.system for block in blocks)]),
            "counts": np.reshape([block.counts for block in blocks], (len(blocks), 3)),
            "lengths": np.asarray([len(block.system) for block in blocks], dtype=np.int64),
            "names": np.asarray(names, dtype=np.str_),
            "rows": np.reshape([row[n][0] for row in rows for n in names], (len(rows), len(names))),
            "recent": np.reshape([row[n] for row in read for n in names], (len(read), len(names))),
            "known": np.asarray([one.known for one in recent], dtype=np.int64),
            "disagree": np.asarray(self.question.disagree, dtype=np.bool_),
            "added": np.asarray(self.window.added, dtype=np.float64),
            "increases": np.asarray(self.increases, dtype=np.float64),
            "variance": np.asarray(self.variance),
            "repeated": np.asarray(self.repeated.times, dtype=np.int64),
            "changes": np.asarray(self.repeated.changes, dtype=np.int64),
            "numbers": np.asarray(
                [
                    self.window.length,
                    self.question.in_succession,
                    self.rows_since_change,
                    self.rows_since_drift,
                ],
                dtype=np.int64,
            ),
        }
        return arrays | {CHECKSUM: np.asarray(checksum_of(arrays))}

    @staticmethod
    def from_arrays(arrays: Mapping[str, Any], identity: str, start: Memory) -> FilterState:
        """The state that `as_arrays` wrote for the file of this identity.

        arrays: From `as_arrays`.
        identity: Of the file.
        start: A memory of the file without rows.
        Raises `InputError` for arrays of another file or version, or damaged ones.
        """
        try:
            return _read(arrays, identity, start)
        except InputError:
            raise
        except Exception as error:  # whatever a damaged array raises
            raise InputError(
                f"this state of a tracker is damaged ({error}): begin with SoilTracker(estimator)"
            ) from None


def checksum_of(arrays: Mapping[str, Any]) -> int:
    """The checksum of the other arrays of a state."""
    names = sorted(name for name in arrays if name != CHECKSUM)
    return state_checksum(*(part for name in names for part in (name, arrays[name])))


def _one_by_one(rows: Rows) -> list[dict[str, float]]:
    """Several rows as one mapping each."""
    return [{n: float(v[i]) for n, v in rows.items()} for i in range(len(rows["slip"]))]


def _read(arrays: Mapping[str, Any], identity: str, start: Memory) -> FilterState:
    if int(arrays["format"]) != FORMAT:
        raise InputError(
            f"this state of a tracker has format {int(arrays['format'])}; this version of soilml "
            f"reads format {FORMAT}: begin with SoilTracker(estimator)"
        )
    if str(arrays["model"]) != identity:
        raise InputError(
            f"this state of a tracker is of {str(arrays['model'])!r}, which is another file, "
            f"wheel, prior or error of sensors than {identity!r}: begin with SoilTracker(estimator)"
        )
    if int(arrays[CHECKSUM]) != checksum_of(arrays):
        raise ValueError("its checksum does not match")
    ends = np.cumsum(arrays["lengths"])
    system = np.asarray(arrays["system"], dtype=start.system.dtype)
    if system.shape != (ends[-1] if len(ends) else 0, start.system.shape[1]):
        raise ValueError(f"its system has shape {system.shape}")
    for part in (system, np.asarray(arrays["counts"], dtype=np.float64)):
        if not (np.abs(part) < np.finfo(np.float32).max).all():
            raise ValueError("it has numbers that are not finite, or too large")
    parts = zip(np.split(system, ends[:-1]), arrays["counts"], strict=True) if len(ends) else ()
    blocks = tuple(
        replace(start, system=part, counts=np.asarray(count, np.float32)) for part, count in parts
    )
    length, in_succession, since_change, since_drift = (int(n) for n in arrays["numbers"])
    added = tuple(float(value) for value in arrays["added"])
    if not len(added) <= len(blocks) or not np.isfinite(added).all():
        raise ValueError(f"it has {len(added)} last rows in {len(blocks)} blocks")
    recent = _read_recent(arrays, blocks[len(blocks) - len(added) :])
    window = RowWindow(blocks, join(blocks) if blocks else start, length, added, recent)
    rows: list[Rows] = [
        {str(n): np.asarray([float(v)]) for n, v in zip(arrays["names"], row, strict=True)}
        for row in arrays["rows"]
    ]
    flags = tuple(bool(flag) for flag in arrays["disagree"])
    previous = rows[0] if rows else None
    question = RowsInQuestion(tuple(rows[1:]), flags, in_succession)
    if len(question.rows) != len(flags):
        raise ValueError(f"it has {len(question.rows)} rows in question and {len(flags)} flags")
    repeated = RepeatedReadings(
        previous, *(tuple(int(n) for n in arrays[name]) for name in ("repeated", "changes"))
    )
    increases = tuple(float(value) for value in arrays["increases"])
    variance = float(arrays["variance"])
    if not 1.0 <= variance < np.inf:
        raise ValueError(f"its noise is {variance:g} times that stated")
    return FilterState(window, question, repeated, increases, since_change, since_drift, variance)


def _read_recent(arrays: Mapping[str, Any], blocks: Sequence[Memory]) -> tuple[RecentRows, ...]:
    """The rows of the recent blocks, as they were read."""
    counts, known = [block.rows for block in blocks], arrays["known"]
    readings = np.asarray(arrays["recent"], dtype=np.float64)
    if len(readings) != sum(counts) or len(known) != len(counts) or np.isinf(readings).any():
        raise ValueError(f"it has {len(readings)} rows as read in {len(counts)} last blocks")
    names = [str(name) for name in arrays["names"]]
    parts = np.split(readings, np.cumsum(counts)[:-1]) if counts else []
    return tuple(
        RecentRows(dict(zip(names, part.T, strict=True)), int(number))
        for part, number in zip(parts, known, strict=True)
    )
