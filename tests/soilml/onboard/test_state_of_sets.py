"""The state of a set between steps: packed, checked, continued."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import simulated_run

from soilml import Estimator
from soilml.errors import InputError
from soilml.onboard.memory import LEAST_SINGULAR_VALUE, PACKED_EVERY, Memory, check_memory
from soilml.onboard.tracking.filter_state import CHECKSUM, FilterState, checksum_of
from soilml.onboard.tracking.row_window import RowWindow
from soilml.onboard.tracking.soil_tracker import Event


def test_a_memory_must_have_finite_numbers_of_its_file():
    good = Memory(np.ones((2, 3)), np.ones(3, np.float32), "file").sealed()
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
    with pytest.raises(InputError, match="has format '1'; this version of soilml reads format '2'"):
        check_memory(replace(good, format="1"), 3, "file", "a.onnx")


def flipped(array, rng):
    """The array with one bit flipped."""
    found = bytearray(array.tobytes())
    found[rng.integers(len(found))] ^= 1 << int(rng.integers(8))
    return np.frombuffer(bytes(found), array.dtype).reshape(array.shape)


@pytest.mark.parametrize("keep", [0, 8])
def test_a_memory_in_which_a_bit_has_flipped_is_refused(keep, wheel_set_file, wheel_posterior):
    estimator, rng = Estimator.load(wheel_set_file), np.random.default_rng(0)
    run, _ = simulated_run(wheel_posterior, 12)
    memory = estimator.start(keep)
    for first in (0, 4, 8):
        part = {name: values[first : first + 4] for name, values in run.items()}
        _, memory = estimator.step(memory, **part)
    row = {name: values[:1] for name, values in run.items()}
    for k in range(1000):
        if keep:
            kept, rows = memory.kept, dict(memory.kept.rows)
            name = list(rows)[k % len(rows)]
            bad = replace(memory, kept=replace(kept, rows=rows | {name: flipped(rows[name], rng)}))
        else:
            part = "counts" if k % 4 == 0 else "system"
            bad = replace(memory, **{part: flipped(getattr(memory, part), rng)})
        with pytest.raises(InputError, match="this memory is damaged"):
            estimator.step(bad, **row)
    assert estimator.step(memory, **row)[1].rows == 13


@pytest.mark.parametrize("part", ["system", "counts"])
def test_a_state_of_a_tracker_must_have_finite_numbers(part):
    start = Memory(np.zeros((0, 3)), np.zeros(3, np.float32), "file")
    row = {"slip": np.asarray([0.2])}
    counts = np.ones(3, np.float32)
    after = replace(start, system=np.ones((2, 3)), counts=counts)
    window = RowWindow.empty(start, 48).with_rows(row, after)
    arrays = FilterState(window).as_arrays("file")
    again = FilterState.from_arrays(arrays, "file", start)
    assert again.window.memory.system.tolist() == window.memory.system.tolist()
    assert (again.rows_since_change, again.rows_since_drift, again.increases) == (0, -1, ())
    assert [(one.rows, one.known) for one in again.window.recent] == [(row, 1)]
    arrays[part] = arrays[part].astype(float)
    arrays[part][0, 1] = np.inf
    with pytest.raises(InputError, match="its checksum does not match"):
        FilterState.from_arrays(arrays, "file", start)
    arrays[CHECKSUM] = checksum_of(arrays)
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


def memory_of(system) -> Memory:
    return Memory(np.asarray(system, np.float64), np.asarray([1.0, 1.0, 1.0], np.float32))


@pytest.fixture(scope="module")
def thin():
    """Sixty rows of nine columns that lie in four directions."""
    rng = np.random.default_rng(0)
    return rng.normal(size=(60, 4)) @ rng.normal(size=(4, 9))


def test_a_packed_memory_has_the_same_sums_of_squares_in_as_few_rows_as_directions(thin):
    packed = memory_of(thin).packed()
    assert len(packed.system) == 4
    assert packed.system.T @ packed.system == pytest.approx(thin.T @ thin, abs=1e-9)


def test_directions_below_the_least_singular_value_are_left_out():
    sizes = np.asarray([5.0, 2.0 * LEAST_SINGULAR_VALUE, 0.5 * LEAST_SINGULAR_VALUE])
    rotated = np.linalg.qr(np.random.default_rng(1).normal(size=(7, 7)))[0][:, :3] * sizes
    kept = memory_of(rotated).packed().system
    assert np.linalg.norm(kept, axis=1) == pytest.approx(sizes[:2])


def test_a_memory_with_few_rows_stays_as_it_is_until_it_has_grown(thin):
    short = memory_of(np.random.default_rng(2).normal(size=(PACKED_EVERY + 1, 50)))
    assert short.packed() is short
    assert short.packed(PACKED_EVERY) is short
    assert short.packed(PACKED_EVERY - 1) is not short


def test_answers_after_packing_are_those_before(whole_file):
    from soilml import Estimator

    estimator, rng = Estimator.load(whole_file), np.random.default_rng(3)
    slip, load = rng.uniform(0.08, 0.5, 90), rng.uniform(40.0, 100.0, 90)
    torque = load * (0.045 + 0.03 * slip)
    one = {"slip": 0.2, "torque": 3.0, "load": 60.0}
    sets = estimator.sets
    rows = sets.rows({"slip": slip, "torque": torque, "load": load})
    _, long = sets.update(estimator.session, rows, estimator.start())
    whole, _ = sets.update(estimator.session, sets.rows(one), long)
    packed, after = estimator.step(long.packed().sealed(), **one)
    assert len(long.packed().system) < len(long.system)
    assert packed.mean == pytest.approx(whole[0], abs=2e-3 * packed.std.min())
    assert packed.std == pytest.approx(whole[1], rel=2e-3)
    for _ in range(3 * PACKED_EVERY):
        _, after = estimator.step(after, **one)
    assert len(after.system) <= after.system.shape[1]


def test_rows_that_are_kept_give_the_answer_of_one_call(wheel_set_file, wheel_posterior):
    run, _ = simulated_run(wheel_posterior, 20)
    estimator = Estimator.load(wheel_set_file)
    together = estimator.run(**run)
    found = {}
    for keep in (0, 12, 20):
        memory = estimator.start(keep)
        for first in range(0, 20, 4):
            part = {name: values[first : first + 4] for name, values in run.items()}
            found[keep], memory = estimator.step(memory, **part)
        assert memory.rows == 20 and found[keep].rows_used == 20
        assert (memory.kept is None) == (keep == 0)
    assert found[20].mean == pytest.approx(together.mean, rel=1e-6)
    assert found[20].std == pytest.approx(together.std, rel=1e-6)
    far = {k: np.abs((found[k].mean - together.mean) / together.std).max() for k in found}
    assert far[20] < 1e-5 < min(far[0], far[12]) and far[12] < 1.0
    # all rows have joined after the last step: nothing is kept twice
    assert memory.kept.rows == {} and memory.kept.before.rows == 20


def test_what_cannot_be_kept_is_refused(wheel_set_file):
    estimator = Estimator.load(wheel_set_file)
    for keep in (-1, 257, 2.0, True):
        with pytest.raises(InputError, match=r"keep is .*; needed is a whole number from 0 to 256"):
            estimator.start(keep)
    memory = estimator.start(keep=4)
    other = replace(memory.kept, before=replace(memory.kept.before, file="another"))
    with pytest.raises(InputError, match="this memory is of 'another'"):
        estimator.step(replace(memory, kept=other).sealed(), slip=0.3, torque=2.0, load=60.0)
