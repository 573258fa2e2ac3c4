"""State of a tracker: rows in question, readings that repeat, and the window remembered."""

from __future__ import annotations

import json
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

FORMAT = 5  # Version of the arrays
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
        window, question, repeated = self.window, self.question, self.repeated
        numbers = {
            "length": window.length,
            "lengths": [len(block.system) for block in window.blocks],
            "added": window.added,
            "recent": [{"rows": as_lists(one.rows), "known": one.known} for one in window.recent],
            "question": [as_lists(row) for row in question.rows],
            "disagree": question.disagree,
            "in_succession": question.in_succession,
            "previous": None if repeated.previous is None else as_lists(repeated.previous),
            "times": repeated.times,
            "changes": repeated.changes,
            "increases": self.increases,
            "rows_since_change": self.rows_since_change,
            "rows_since_drift": self.rows_since_drift,
            "variance": self.variance,
        }
        blocks = window.blocks
        arrays = {
            "format": np.asarray(FORMAT),
            "model": np.asarray(identity),
            "system": np.concatenate([window.memory.system[:0], *(b.system for b in blocks)]),
            "counts": np.reshape([block.counts for block in blocks], (len(blocks), 3)),
            "numbers": np.asarray(json.dumps(numbers)),
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


def as_lists(row: Rows) -> dict[str, list[float]]:
    """Rows (m,) by name as lists."""
    return {name: values.tolist() for name, values in row.items()}


def _rows_of(entry: Mapping[str, Any]) -> Rows:
    """The inverse of `as_lists`."""
    return {name: np.asarray(values, np.float64) for name, values in entry.items()}


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
    numbers = json.loads(str(arrays["numbers"]))
    ends = np.cumsum([0, *numbers["lengths"]])
    system = np.asarray(arrays["system"], dtype=start.system.dtype)
    if system.shape != (ends[-1], start.system.shape[1]):
        raise ValueError(f"its system has shape {system.shape}")
    for part in (system, np.asarray(arrays["counts"], dtype=np.float64)):
        if not (np.abs(part) < np.finfo(np.float32).max).all():
            raise ValueError("it has numbers that are not finite, or too large")
    parts = zip(np.split(system, ends[1:-1]), arrays["counts"], strict=len(ends) > 1)
    blocks = tuple(
        replace(start, system=part, counts=np.asarray(count, np.float32)) for part, count in parts
    )
    recent = tuple(RecentRows(_rows_of(r["rows"]), int(r["known"])) for r in numbers["recent"])
    memory = join(blocks) if blocks else start
    window = RowWindow(blocks, memory, numbers["length"], tuple(numbers["added"]), recent)
    rows = tuple(_rows_of(row) for row in numbers["question"])
    previous = None if numbers["previous"] is None else _rows_of(numbers["previous"])
    return FilterState(
        window,
        RowsInQuestion(rows, tuple(numbers["disagree"]), numbers["in_succession"]),
        RepeatedReadings(previous, tuple(numbers["times"]), tuple(numbers["changes"])),
        tuple(numbers["increases"]),
        numbers["rows_since_change"],
        numbers["rows_since_drift"],
        numbers["variance"],
    )
