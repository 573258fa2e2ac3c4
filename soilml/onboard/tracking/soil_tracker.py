"""Estimates along a drive whose soil changes and whose sensors fail at times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, final

import numpy as np

from soilml.errors import InputError
from soilml.numerics.quantiles import chi_squared_quantile
from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import Estimator
from soilml.onboard.exact_check import with_exact_check
from soilml.onboard.features import READABLE, as_number
from soilml.onboard.memory import Memory
from soilml.onboard.set_contract import OPTIONAL_READINGS, REQUIRED_READINGS
from soilml.onboard.tracking.filter_state import GIVE_UP_AFTER, FilterState
from soilml.onboard.tracking.misfit import (
    CHANGE_QUANTILE,
    ERROR_DEGREES,
    MOST_VARIANCE,
    QUANTILE,
    ROWS_JUDGED,
    JointFit,
    Rows,
    excess_noise,
    fit_memory,
    fit_rows,
    judging,
    usual_excess,
)
from soilml.onboard.tracking.row_window import RowWindow, join
from soilml.onboard.tracking.state_file import packed_state, unpacked_state

#: After so many rows the last half of the rows is compared with the first, for a slow drift.
HALVES_EVERY = 4
DEFAULT_LENGTH = 100  # Rows that a tracker remembers by default


class Event(IntEnum):
    """What a row was found to be. Numbers are never reused."""

    #: Agrees with the rows before, and is used.
    ACCEPTED = 0
    #: Disagrees with the rows before: a glitch, or the first row of another soil. Not used.
    SET_ASIDE = 1
    #: With this row there are enough of another soil; the rows before them are forgotten.
    SOIL_CHANGED = 2
    #: Recent rows together disagree with earlier ones, which are forgotten.
    DRIFT = 3
    #: A sensor repeats its reading while slip or load change. Not used.
    STUCK = 4
    #: All readings are those of the row before, which counts once. Not used.
    REPEATED = 5
    #: Not a number, impossible, or out of the range of the file. Not used.
    UNUSABLE = 6


@dataclass(frozen=True)
class TrackerState:
    """The soil after a row of a drive.

    Attributes
    ----------
    estimate : Estimate
        From the rows that are remembered; the prior where there are none.
    event : Event
        What the row was found to be.
    words : str
        The same as a sentence.
    rows_since_change : int
        Rows used since the start, or since the first row of the present soil.
    rows_remembered : int
        The last ones of them, on which the estimate rests.
    rows_in_question : int
        Rows set aside of late. They are glitches, or the first ones of another soil: the estimate
        may be that of the soil before while this is not zero.
    drifting : bool
        Whether a drift was found within as many rows as are remembered at most: the estimate may
        lag behind, and it is wrong if what drifts is a sensor.
    """

    estimate: Estimate
    event: Event
    words: str
    rows_since_change: int
    rows_remembered: int
    rows_in_question: int
    drifting: bool


@final
class SoilTracker:
    """The soil along a drive: rows one by one, each checked against those before.

    A row whose misfit with the rows remembered is not chance is set aside. Where several such rows
    agree with each other, the soil has changed, and the tracker begins anew with them; where the
    next rows agree with those before, it was a glitch. Rows that differ from earlier ones only
    taken together are a drift, or a small change; the earlier ones are forgotten. Of the others,
    the last `length` are remembered. Memory and time per row are bounded: at most four calls of the
    graph, one more for the fault detector, and one where rows are forgotten. Rows are judged with a
    model that is right but for more noise; the estimate has the errors of the estimator's model,
    and noise as large as the rows show.

    Parameters
    ----------
    estimator : Estimator
        With a set posterior; for a file for many wheels, after `Estimator.on`.
    length : int
        Rows that are remembered, 16 or more; up to a sixteenth more are.

    Attributes
    ----------
    state : TrackerState
        The last answer.

    Raises `InputError` for a length that is too small, or an estimator without a set posterior.

    Examples
    --------
    >>> from soilml import Estimator, SoilTracker
    >>> tracker = SoilTracker(Estimator.load("exported/wheel.onnx"))
    >>> for slip, torque in [(0.1, 1.6), (0.2, 2.3), (0.3, 2.7), (0.5, 3.2), (0.4, 5.9)]:
    ...     state = tracker.read(slip=slip, torque=torque, load=60.0)
    >>> state.event.name, state.rows_remembered, state.rows_in_question
    ('SET_ASIDE', 4, 1)
    """

    estimator: Estimator
    length: int
    state: TrackerState
    _empty: Memory
    _judge: Estimator  # tells rows of another soil
    _estimated: tuple[Memory, Estimate] | None  # the last estimate, and its memory
    _filter: FilterState
    _fit: JointFit

    def __init__(self, estimator: Estimator, length: int = DEFAULT_LENGTH) -> None:
        if isinstance(length, bool) or not isinstance(length, int | np.integer) or length < 16:
            raise InputError(f"length is {length!r}; needed is a whole number of 16 or more rows")
        self.estimator = estimator
        self.length = int(length)
        self._judge = judging(estimator)
        self._estimated = None
        self._empty = estimator.start()
        self._begin(FilterState(RowWindow((), self._empty, self.length)))

    def read(self, **measured: float) -> TrackerState:
        """The state after one more row.

        Parameters
        ----------
        **measured : float
            Slip, torque, load and the further inputs of `Estimator.step`, in SI units. A value that
            is not finite or impossible makes the row unusable; it raises no error.

        Raises `InputError` for a reading that is missing or unknown, or is not one number, and for
        standard deviations that are not possible.
        """
        row = self._row(measured)
        if isinstance(row, str):
            return self._answer(Event.UNUSABLE, row)
        repeated = self._filter.repeated
        if repeated.repeats(row):
            return self._answer(Event.REPEATED, "all readings are those of the row before")
        self._filter = replace(self._filter, repeated=repeated.with_row(row))
        if stuck := self._filter.repeated.stuck:
            question = self._filter.question.without_reading(stuck, float(row[stuck][0]))
            self._filter = replace(self._filter, question=question)
            words = f"{stuck} repeats {row[stuck][0]:g} while slip or load change: not used"
            return self._answer(Event.STUCK, words)
        return self._check(row)

    def restart(self) -> TrackerState:
        """Forget all rows, because the soil is known to be another one."""
        self._begin(FilterState(RowWindow((), self._empty, self.length)))
        return self.state

    def save(self) -> bytes:
        """All that is remembered; see `restore`, and `write_state` for a file of it."""
        return packed_state(self._filter, self.estimator.memory_id)

    @staticmethod
    def restore(estimator: Estimator, content: bytes, length: int = DEFAULT_LENGTH) -> SoilTracker:
        """The tracker that `save` wrote, also in another process.

        Raises `InputError` for bytes of another file, wheel, prior or version, or damaged ones.

        Examples
        --------
        >>> from soilml import Estimator, SoilTracker
        >>> estimator = Estimator.load("exported/wheel.onnx")
        >>> content = SoilTracker(estimator).save()
        >>> tracker = SoilTracker.restore(estimator, content)
        >>> tracker.state.rows_remembered
        0
        """
        tracker = SoilTracker(estimator, length)
        state = unpacked_state(content, estimator.memory_id, tracker._empty)
        if state.window.length != length:
            raise InputError(
                f"length is {length}, but this state of a tracker has length "
                f"{state.window.length}: give the length that it was made with"
            )
        tracker._begin(state)
        return tracker

    def _begin(self, state: FilterState) -> None:
        """Continue from a state of the filter."""
        self._filter = state
        self._fit = fit_memory(self._judge, state.window.memory)
        self._answer(Event.ACCEPTED, "no row was read since the start")

    def _row(self, measured: Mapping[str, Any]) -> Rows | str:
        """Inputs of the graph for a row, or why it cannot be used."""
        numbers = {name: as_number(name, value) for name, value in measured.items()}
        for name, value in numbers.items():
            low, high = READABLE.get(name, (-np.inf, np.inf))
            absent = name in OPTIONAL_READINGS and np.isnan(value)
            if name in READABLE and not (low < value < high or absent):
                return f"{name} is {value:g}, which is not possible: not used"
        missing = [name for name in REQUIRED_READINGS if name not in numbers]
        if missing:
            raise InputError(f"{missing[0]} is missing; a row needs {', '.join(REQUIRED_READINGS)}")
        assert self.estimator.sets is not None
        return self.estimator.sets.rows({name: [value] for name, value in numbers.items()})

    def _check(self, row: Rows) -> TrackerState:
        """Compare a row with those remembered."""
        before, window = self._fit, self._filter.window
        fit = fit_rows(self._judge, row, window.memory)
        readings = fit.readings - before.readings
        if readings < 0.5:
            words = "slip, load or noise are out of the range of the file: not used"
            return self._answer(Event.UNUSABLE, words)
        misfit = fit.misfit - before.misfit
        limit = chi_squared_quantile(readings, QUANTILE)
        limit *= self._excess(before.misfit, before.readings)
        increases = (*self._filter.increases, misfit / chi_squared_quantile(readings, 0.0))
        state = replace(self._filter, increases=increases[-ROWS_JUDGED:])
        if misfit > limit and window.blocks:
            question = state.question.with_row(row, True)
            self._filter = replace(state, question=question)
            return self._other_soil(f"its misfit {misfit:.0f} is above {limit:.0f}")
        question = state.question.with_row(row, False) if state.question.rows else state.question
        since_drift = state.rows_since_drift
        self._filter = replace(
            state,
            window=window.with_rows(fit.memory, misfit),
            question=question,
            rows_since_change=state.rows_since_change + 1,
            rows_since_drift=since_drift + 1 if 0 <= since_drift < self.length else -1,
        )
        self._fit = fit
        return self._look_for_drift()

    def _other_soil(self, words: str) -> TrackerState:
        """Whether the rows in question are of another soil."""
        question = self._filter.question
        for rows in question.candidates():
            fit = fit_rows(self._judge, rows, self._empty)
            degrees = max(fit.readings - len(self.estimator.names), 1.0)
            excess = self._excess(self._fit.misfit, self._fit.readings)
            agree = fit.misfit <= excess * chi_squared_quantile(degrees, QUANTILE)
            if agree or question.in_succession >= GIVE_UP_AFTER:
                return self._begin_with(rows, fit, agree)
        return self._answer(
            Event.SET_ASIDE, f"disagrees with the rows before, as {words}: not used"
        )

    def _begin_with(self, rows: Rows, fit: JointFit, agree: bool) -> TrackerState:
        """Forget all but some rows in question."""
        count, earlier = len(rows["slip"]), self._filter.window.memory.rows
        window = RowWindow((), self._empty, self.length).with_rows(fit.memory)
        state = self._filter  # the size of the model error is kept
        kept = max(len(state.increases) - len(state.question.rows), 0)
        self._filter = FilterState(
            window,
            repeated=state.repeated,
            increases=state.increases[:kept],
            rows_since_change=window.memory.rows,
            variance=state.variance,
        )
        self._fit = fit
        each_other = "agree" if agree else "do not agree either"
        words = f"the last {count} rows {each_other} with each other, and not with {earlier} before"
        return self._answer(Event.SOIL_CHANGED, f"{words}: these are forgotten")

    def _look_for_drift(self) -> TrackerState:
        """Compare recent rows with earlier ones, and forget what is too old."""
        state, words = self._filter, "agrees with the rows before"
        window, blocks = state.window, len(state.window.blocks)
        first = self._split(window)
        if 0 < first < blocks:
            recent = window.since(first)
            old = fit_memory(self._judge, join(window.blocks[:first]))
            new = fit_memory(self._judge, recent.memory)
            apart = old.misfit + new.misfit
            unknowns = len(self.estimator.names)
            # not that of the last rows one by one, which another soil raises
            excess = max(excess_noise(apart, self._fit.readings, 2 * unknowns), 1.0)
            limit = excess * chi_squared_quantile(unknowns + ERROR_DEGREES, CHANGE_QUANTILE)
            if self._fit.misfit - apart > limit:
                # what rows added to the misfit was of the other soil
                window = replace(recent, added=(0.0,) * len(recent.added))
                self._filter = replace(state, window=window, rows_since_drift=0)
                self._fit = new
                words = (
                    f"the last {recent.memory.rows} rows together differ from {old.memory.rows} "
                    "before, so that soil or sensors drift: these are forgotten"
                )
                return self._answer(Event.DRIFT, words)
        if window.memory.rows > window.length + window.rows_per_block:
            self._filter = replace(state, window=window.since(1))
            self._fit = fit_memory(self._judge, self._filter.window.memory)
        return self._answer(Event.ACCEPTED, words)

    def _split(self, window: RowWindow) -> int:
        """The block with which other rows are compared with those before."""
        if self._filter.rows_since_change % HALVES_EVERY:
            excess = excess_noise(self._fit.misfit, self._fit.readings, len(self.estimator.names))
            return window.suspect(max(excess, 1.0))
        rows = np.cumsum([block.rows for block in window.blocks])
        return int(np.searchsorted(rows, 0.5 * rows[-1]))

    def _excess(self, misfit: float, readings: float) -> float:
        """Variance of residuals over that of the stated noise, 1 or more: of a fit, or of rows."""
        usual = usual_excess(self._filter.increases)
        return max(excess_noise(misfit, readings, len(self.estimator.names)), usual)

    def _answer(self, event: Event, words: str) -> TrackerState:
        estimate, state = self._estimate(), self._filter
        self.state = TrackerState(
            estimate=estimate,
            event=event,
            words=words,
            rows_since_change=state.rows_since_change,
            rows_remembered=state.window.memory.rows,
            rows_in_question=state.question.count,
            drifting=state.rows_since_drift >= 0,
        )
        return self.state

    def _estimate(self) -> Estimate:
        """From the rows that are remembered, with errors of the model and noise as rows show it."""
        memory, variance = self._filter.window.memory, self._filter.variance
        if self._estimated is None or self._estimated[0] is not memory:
            noisy = replace(memory, system=memory.system / np.sqrt(variance))
            fit = fit_memory(self.estimator, noisy)
            sets, session = self.estimator.sets, self.estimator.session
            assert sets is not None
            checked = with_exact_check(fit.estimate, sets, session, memory, self._fit.estimate)
            self._estimated = memory, checked
            shown = variance * excess_noise(fit.misfit, fit.readings, len(self.estimator.names))
            variance = float(np.clip(shown, 1.0, MOST_VARIANCE))
            self._filter = replace(self._filter, variance=variance)
        return self._estimated[1]
