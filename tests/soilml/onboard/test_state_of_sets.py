"""The state of a set between steps: packed, checked, continued."""

from dataclasses import replace

import numpy as np
import pytest
from bit_flips import flipped
from conftest import simulated_run

from soilml import Estimator
from soilml.errors import InputError
from soilml.onboard.memory import PACKED_EVERY, Memory


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


def test_a_packed_memory_has_the_same_sums_of_squares_in_as_few_rows_as_directions():
    rng = np.random.default_rng(0)
    thin = rng.normal(size=(60, 4)) @ rng.normal(size=(4, 9))
    packed = Memory(thin, np.ones(3, np.float32)).packed()
    assert len(packed.system) == 4
    assert packed.system.T @ packed.system == pytest.approx(thin.T @ thin, abs=1e-9)


def test_answers_after_packing_are_those_before(whole_file):
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
