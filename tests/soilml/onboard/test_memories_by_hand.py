"""What is refused as a memory, and what a tracker remembers."""

from dataclasses import replace

import numpy as np
import pytest

from soilml.errors import InputError
from soilml.onboard.memory import Memory, check_memory
from soilml.onboard.tracking.filter_state import FilterState, RowWindow
from soilml.onboard.tracking.soil_tracker import Event


def test_a_memory_must_have_finite_numbers_of_its_file():
    good = Memory(np.ones((2, 3)), np.ones(3, np.float32), "file")
    assert check_memory(good, 3, "file", "a.onnx") is good and good.rows == 1
    nan, inf = np.asarray([np.nan, 1.0, 1.0]), np.asarray([np.inf, -np.inf, 1.0])
    for bad in (
        replace(good, counts=nan),
        replace(good, system=np.vstack([good.system, nan])),
        replace(good, system=np.vstack([good.system, inf])),
        replace(good, counts=np.ones(2)),
        replace(good, system=np.ones((2, 4))),
    ):
        with pytest.raises(InputError, match="this memory is damaged"):
            check_memory(bad, 3, "file", "a.onnx")
    with pytest.raises(InputError, match="another file, wheel, prior"):
        check_memory(good, 3, "other", "a.onnx")


@pytest.mark.parametrize("part", ["system", "counts"])
def test_a_state_of_a_tracker_must_have_finite_numbers(part):
    start = Memory(np.zeros((0, 3)), np.zeros(3, np.float32), "file")
    window = RowWindow.empty(start, 48).with_rows(replace(start, system=np.ones((2, 3))))
    arrays = FilterState(window).as_arrays("file")
    again = FilterState.from_arrays(arrays, "file", start)
    assert again.window.memory.system.tolist() == window.memory.system.tolist()
    assert (again.rows_since_change, again.rows_since_drift, again.increases) == (0, -1, ())
    arrays[part] = arrays[part].astype(float)
    arrays[part][0, 1] = np.inf
    with pytest.raises(InputError, match="numbers that are not finite"):
        FilterState.from_arrays(arrays, "file", start)


def test_increases_of_the_last_sixteen_rows_are_kept():
    start = Memory(np.zeros((0, 3)), np.zeros(3, np.float32), "file")
    memory = FilterState(RowWindow.empty(start, 48), rows_since_change=7, rows_since_drift=3)
    for i in range(20):
        memory = memory.with_increase(float(i))
    assert memory.increases == tuple(float(i) for i in range(4, 20))
    row = {"slip": np.asarray([0.1])}
    asked = replace(memory, question=memory.question.with_row(row, True).with_row(row, True))
    rows = replace(start, counts=np.asarray([0.0, 5.0, 0.0]))
    other = asked.of_another_soil(replace(asked.window, memory=rows))
    assert other.increases == memory.increases[:14]
    assert (other.rows_since_change, other.rows_since_drift) == (5, -1)
    few = replace(asked, increases=(1.0,))
    assert few.of_another_soil(asked.window).increases == ()


def test_the_numbers_of_events_are_fixed():
    """They are written into logs of drives."""
    names = ["ACCEPTED", "SET_ASIDE", "SOIL_CHANGED", "DRIFT", "STUCK", "REPEATED", "UNUSABLE"]
    assert {event.name: int(event) for event in Event} == {n: i for i, n in enumerate(names)}


def test_rows_in_question_are_remembered_with_their_flags():
    start = Memory(np.zeros((0, 3)), np.zeros(3, np.float32), "file")
    row = {"slip": np.asarray([0.1]), "load": np.asarray([60.0])}
    memory = FilterState(RowWindow.empty(start, 48))
    question = memory.question.with_row(row, True).with_row(row, False)
    repeated = memory.repeated.with_row(row)
    arrays = replace(memory, question=question, repeated=repeated).as_arrays("file")
    assert arrays["disagree"].dtype == np.bool_ and arrays["disagree"].tolist() == [True, False]
    empty = memory.as_arrays("file")
    assert empty["disagree"].dtype == np.bool_ and empty["disagree"].size == 0
    assert empty["lengths"].dtype == empty["numbers"].dtype == np.int64
    again = FilterState.from_arrays(arrays, "file", start)
    assert again.question.disagree == (True, False) and len(again.question.rows) == 2
    question = question.with_row(row, True).with_row(row, True)
    stray = replace(memory, question=question, repeated=repeated)
    again = FilterState.from_arrays(stray.as_arrays("file"), "file", start)
    assert again.question.in_succession == question.in_succession == 2
