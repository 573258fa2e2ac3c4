"""A memory of many readings keeps what they say in few rows."""

import numpy as np
import pytest

from soilml.onboard.memory import LEAST_SINGULAR_VALUE, PACKED_EVERY, Memory


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
    packed, after = estimator.step(long.packed(), **one)
    assert len(long.packed().system) < len(long.system)
    assert packed.mean == pytest.approx(whole[0], abs=2e-3 * packed.std.min())
    assert packed.std == pytest.approx(whole[1], rel=2e-3)
    for _ in range(3 * PACKED_EVERY):
        _, after = estimator.step(after, **one)
    assert len(after.system) <= after.system.shape[1]
