"""All that a tracker remembers, and how it is written as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.onboard.memory import Memory
from soilml.onboard.tracking.joint_fit import Rows
from soilml.onboard.tracking.misfit_limits import ROWS_JUDGED
from soilml.onboard.tracking.repeated_readings import RepeatedReadings
from soilml.onboard.tracking.row_window import RowWindow, join
from soilml.onboard.tracking.rows_in_question import RowsInQuestion

Arrays = dict[str, NDArray[Any]]

#: Version of the arrays.
FORMAT = 1


@dataclass(frozen=True)
class TrackerMemory:
    """What a tracker remembers of the rows before.

    Parameters
    ----------
    window : RowWindow
        The rows that the estimate rests on.
    question : RowsInQuestion
        Rows that may be of another soil.
    repeated : RepeatedReadings
        Which readings repeat.
    increases : tuple of float
        What each of the last rows added to the misfit, over its median for sound rows.
    rows_since_change : int
        Rows used since the soil changed.
    rows_since_drift : int
        Rows used since a drift was last found; -1: never, on this soil.
    """

    window: RowWindow
    question: RowsInQuestion = field(default_factory=RowsInQuestion)
    repeated: RepeatedReadings = field(default_factory=RepeatedReadings)
    increases: tuple[float, ...] = ()
    rows_since_change: int = 0
    rows_since_drift: int = -1

    def with_increase(self, value: float) -> TrackerMemory:
        """The memory after a row that added so much to the misfit, over its median."""
        return replace(self, increases=(*self.increases, value)[-ROWS_JUDGED:])

    def of_another_soil(self, window: RowWindow) -> TrackerMemory:
        """The memory with rows of another soil alone; how far the model is off is still known."""
        kept = len(self.increases) - len(self.question.rows)
        return TrackerMemory(
            window,
            repeated=self.repeated,
            increases=self.increases[: max(kept, 0)],
            rows_since_change=window.memory.rows,
        )

    def as_arrays(self, identity: str) -> Arrays:
        """Everything as arrays of numbers and text, for `numpy.savez`."""
        blocks = self.window.blocks
        empty = self.window.memory.system[:0]
        previous = [] if self.repeated.previous is None else [self.repeated.previous]
        rows = [*previous, *self.question.rows]
        names = list(rows[0]) if rows else []
        return {
            "format": np.asarray(FORMAT),
            "model": np.asarray(identity),
            "system": np.concatenate([empty, *(block.system for block in blocks)]),
            "counts": np.reshape([block.counts for block in blocks], (len(blocks), 3)),
            "lengths": np.asarray([len(block.system) for block in blocks], dtype=np.int64),
            "names": np.asarray(names, dtype=np.str_),
            "rows": np.reshape([row[n][0] for row in rows for n in names], (len(rows), len(names))),
            "disagree": np.asarray(self.question.disagree, dtype=np.bool_),
            "increases": np.asarray(self.increases, dtype=np.float64),
            "repeated": np.asarray(self.repeated.times, dtype=np.int64),
            "numbers": np.asarray(
                [
                    self.window.rows_per_block,
                    self.question.in_succession,
                    self.rows_since_change,
                    self.rows_since_drift,
                ],
                dtype=np.int64,
            ),
        }

    @staticmethod
    def from_arrays(arrays: Mapping[str, Any], identity: str, start: Memory) -> TrackerMemory:
        """The memory that `as_arrays` wrote for the file of this identity.

        Parameters
        ----------
        arrays : mapping
            From `as_arrays`.
        identity : str
            Of the file.
        start : Memory
            A memory of the file without rows.

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


def _read(arrays: Mapping[str, Any], identity: str, start: Memory) -> TrackerMemory:
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
    per_block, in_succession, since_change, since_drift = (int(n) for n in arrays["numbers"])
    window = RowWindow(blocks, join(blocks) if blocks else start, per_block)
    rows: list[Rows] = [
        {str(n): np.asarray([float(v)]) for n, v in zip(arrays["names"], row, strict=True)}
        for row in arrays["rows"]
    ]
    flags = tuple(bool(flag) for flag in arrays["disagree"])
    previous = rows[0] if rows else None
    question = RowsInQuestion(tuple(rows[1:]), flags, in_succession)
    if len(question.rows) != len(flags):
        raise ValueError(f"it has {len(question.rows)} rows in question and {len(flags)} flags")
    repeated = RepeatedReadings(previous, tuple(int(n) for n in arrays["repeated"]))
    increases = tuple(float(value) for value in arrays["increases"])
    return TrackerMemory(window, question, repeated, increases, since_change, since_drift)
