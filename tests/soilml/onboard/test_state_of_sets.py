"""The state of a set between steps: packed, checked, continued."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import simulated_run

from soilml import Estimator
from soilml.errors import InputError
from soilml.onboard.memory import PACKED_EVERY, Memory, check_memory


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
    with pytest.raises(InputError, match="another file, version, wheel, prior"):
        check_memory(good, 3, "other", "a.onnx")


def flipped(array, rng):
    """The array with one bit flipped."""
    found = bytearray(array.tobytes())
    found[rng.integers(len(found))] ^= 1 << int(rng.integers(8))
    return np.frombuffer(bytes(found), array.dtype).reshape(array.shape)


def test_a_memory_in_which_a_bit_has_flipped_is_refused(wheel_set_file, wheel_posterior):
    estimator, rng = Estimator.load(wheel_set_file), np.random.default_rng(0)
    run, _ = simulated_run(wheel_posterior, 12)
    memory = estimator.start()
    for first in (0, 4, 8):
        part = {name: values[first : first + 4] for name, values in run.items()}
        _, memory = estimator.step(memory, **part)
    row = {name: values[:1] for name, values in run.items()}
    for k in range(200):
        part = "counts" if k % 4 == 0 else "system"
        bad = replace(memory, **{part: flipped(getattr(memory, part), rng)})
        with pytest.raises(InputError, match="this memory is damaged"):
            estimator.step(bad, **row)
    assert estimator.step(memory, **row)[1].rows == 13


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
