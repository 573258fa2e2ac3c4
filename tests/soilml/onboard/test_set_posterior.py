"""Estimates from sets of readings of one soil, onboard."""

import json

import numpy as np
import pytest
from conftest import simulated_run
from signed_files import signed
from simulated_rows import ANY_WHEEL

from soilml.errors import InputError, ModelFileError
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import COMMON_ERROR_INPUTS

#: Sensors without errors that all readings share.
EXACT = dict.fromkeys(COMMON_ERROR_INPUTS, 0.0)


@pytest.fixture(scope="module")
def any_wheel(any_set_file):
    return Estimator.load(any_set_file)


def assert_similar(a, b, tolerance=0.05):
    """Assert that two estimates differ by a small share of their standard deviation."""
    assert a.in_range == b.in_range
    assert (np.abs(a.mean - b.mean) < tolerance * b.std).all()
    assert (np.abs(np.log(a.std / b.std)) < tolerance).all()


@pytest.mark.slow
def test_the_soil_is_inside_the_interval(wheel_sets, wheel_posterior):
    run, _ = simulated_run(wheel_posterior, 24)
    found = wheel_sets.run(**run)
    axes, x = wheel_posterior.family.axes, (0.2, -0.3, 0.1)
    truth = np.asarray([axis.value(np.asarray(v)) for axis, v in zip(axes, x, strict=True)])
    assert found.in_range
    assert (np.abs(truth - found.mean) < 4.0 * found.std).all()
    assert (found.std < found.prior_std).all()


def test_the_order_of_rows_changes_nothing(wheel_sets, wheel_posterior):
    run, _ = simulated_run(wheel_posterior, 16)
    order = np.random.default_rng(1).permutation(16)
    assert_similar(wheel_sets.run(**{k: v[order] for k, v in run.items()}), wheel_sets.run(**run))


def test_steps_by_row_give_the_estimate_of_the_whole_run(wheel_sets, wheel_posterior):
    run, _ = simulated_run(wheel_posterior, 12)
    memory = wheel_sets.start()
    for i in range(12):
        found, memory = wheel_sets.step(memory, **{k: v[i] for k, v in run.items()})
    assert memory.rows == 12
    # errors of slip and load are linear at the soil that is known when a row arrives
    assert_similar(found, wheel_sets.run(**run), 0.15)
    exact = wheel_sets.on(**EXACT)
    memory = exact.start()
    for i in range(12):
        found, memory = exact.step(memory, **{k: v[i] for k, v in run.items()})
    assert_similar(found, exact.run(**run))


def test_copies_of_a_row_count_once(wheel_sets, wheel_posterior):
    run, _ = simulated_run(wheel_posterior, 6)
    copied = {k: np.concatenate([v, v[:3], v]) for k, v in run.items()}
    assert_similar(wheel_sets.run(**copied), wheel_sets.run(**run), 1e-5)


def test_the_estimate_out_of_range_is_the_prior(wheel_sets, wheel_posterior):
    upper = wheel_posterior.family.recipe.load.upper
    found = wheel_sets.run(slip=0.3, load=3.0 * upper, torque=0.05 * upper)
    assert not found.in_range
    assert found.mean == pytest.approx(wheel_sets.prior.mean, rel=1e-5)
    assert found.std == pytest.approx(wheel_sets.prior.std, rel=1e-5)


def test_a_file_for_any_wheel_requires_its_context(any_wheel):
    with pytest.raises(InputError, match="wheel_radius"):
        any_wheel.run(slip=0.3, torque=2.0, load=60.0)
    with pytest.raises(InputError, match=r"give bearing_std first"):
        any_wheel.on(**{k: v for k, v in ANY_WHEEL.items() if k != "bearing_std"}).start()


@pytest.mark.parametrize("name", ANY_WHEEL)
def test_a_context_out_of_range_is_refused(any_wheel, name):
    for value in (1e9, -1.0, np.nan):
        with pytest.raises(InputError, match=name):
            any_wheel.on(**ANY_WHEEL | {name: value})


@pytest.mark.parametrize("key", ["terms", "noise", "context", "alone"])
def test_a_set_that_lacks_a_key_is_refused(wheel_sets, wheel_set_file, tmp_path, key):
    of_set = json.loads(wheel_sets.metadata["set"])
    del of_set[key]
    with pytest.raises(ModelFileError, match="metadata is damaged"):
        Estimator.load(signed(wheel_set_file, tmp_path / "m.onnx", set=json.dumps(of_set)))


def test_more_rows_than_one_call_takes_are_read_in_parts(wheel_sets, wheel_posterior, monkeypatch):
    rows, _ = simulated_run(wheel_posterior, 60)
    exact = wheel_sets.on(model_error=0.0)
    whole, averaged = exact.run(**rows), wheel_sets.run(**rows)
    monkeypatch.setattr("soilml.onboard.set_posterior.ROWS_PER_CALL", 16)
    parts = exact.run(**rows)
    assert_similar(parts, whole)
    # errors of the model are linear at the soil that is known when a row arrives
    assert (np.abs(wheel_sets.run(**rows).mean - averaged.mean) < 0.5 * averaged.std).all()
    assert (parts.mean != whole.mean).any() and parts.rows_used == 60  # not the same computation
