"""What an estimator says beside its estimate, and how it meets what is not as it should be."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from simulated_rows import ANY_WHEEL

from soilml import Model, Operating, Wheel, soil
from soilml.errors import InputError
from soilml.onboard import Estimate, Estimator, Reason
from soilml.onboard.multi_sensor import fuse_estimates
from soilml.onboard.set_contract import COMMON_ERROR_INPUTS

ROWS = {"slip": [0.1, 0.3, 0.5], "torque": [1.3, 3.1, 5.0], "load": [40.0, 60.0, 80.0]}
ONE = {"slip": 0.3, "torque": 3.1, "load": 60.0}


@pytest.fixture(scope="module")
def whole(whole_file):
    return Estimator.load(whole_file)


@pytest.fixture(scope="module")
def pooling(small_model):
    return Estimator.load(small_model)


#: Sensors without errors that all readings share.
EXACT = dict.fromkeys(COMMON_ERROR_INPUTS, 0.0)


def many(count, **changes):
    """So many different rows on one soil of the prior, some of them replaced."""
    slip = np.linspace(0.1, 0.5, count)
    sand = soil("wong1989/dry_sand", cohesion=1300.0, friction_angle=0.6, shear_modulus=0.015)
    force = Model(Wheel(radius=0.15, width=0.12))(sand, Operating(slip=slip, load=60.0))
    rows = {"slip": slip, "torque": np.asarray(force.torque), "load": np.full(count, 60.0)}
    for name, values in changes.items():
        rows[name][: len(values)] = values
    return rows


def line_of(error):
    assert "\n" not in str(error.value)
    return str(error.value)


def test_an_estimate_of_a_set_counts_its_rows(whole):
    found = whole.run(**ROWS)
    assert found.reason == Reason.ESTIMATED and found.explanation == "estimated from the readings"
    assert (found.rows_used, found.rows_set_aside) == (3, 0)
    assert 0.0 <= found.misfit < 10.0
    found = whole.run(**many(20, load=[2000.0]))
    assert found.reason == Reason.ESTIMATED
    assert (found.rows_used, found.rows_set_aside) == (19, 1)


def test_the_reason_of_a_refused_set_is_told(whole):
    some = whole.run(**many(20, load=[2000.0] * 10))
    assert some.reason == Reason.ESTIMATED and (some.rows_used, some.rows_set_aside) == (10, 10)
    out = whole.run(**many(20, load=[2000.0] * 11))
    assert out.reason == Reason.OUT_OF_RANGE and (out.rows_used, out.rows_set_aside) == (9, 11)
    assert "out of range" in out.explanation
    falling = {"slip": [0.1, 0.3, 0.5], "torque": [5.0, 3.1, 1.5], "load": [60.0] * 3}
    wild = whole.on(**EXACT).run(**falling, torque_bias=0.0)
    assert wild.reason == Reason.INCONSISTENT and wild.misfit > 20.0
    assert wild.explanation == "no soil of the prior explains all rows"
    vague = whole.run(**ROWS, torque_std=np.full(3, 1e3))
    assert vague.reason == Reason.NO_INFORMATION and "noise" in vague.explanation
    for refused in (out, wild, vague):
        assert not refused.in_range and refused.abstains.all()
    for refused in (out, vague):
        np.testing.assert_allclose(refused.std, whole.prior.std, rtol=0.01)
    assert not np.allclose(wild.mean, whole.prior.mean, rtol=0.01)


def test_single_readings_and_pooled_ones_have_their_reasons(whole, pooling):
    found = whole(slip=[0.3, 0.3], torque=[3.1, 90.0], load=60.0)
    assert found.reason.tolist() == [Reason.ESTIMATED, Reason.OUT_OF_RANGE]
    assert found.rows_used.tolist() == [1, 0] and found.rows_set_aside.tolist() == [0, 1]
    assert np.isnan(found.misfit).all() and "out of range" in found.explanation[1]
    stray = pooling.run(**many(20, torque=[90.0]))
    assert (stray.rows_used, stray.rows_set_aside) == (19, 1)
    assert stray.reason == Reason.ESTIMATED
    assert pooling.run(**many(20, torque=[90.0] * 11)).reason == Reason.OUT_OF_RANGE


def test_stacked_estimates_keep_the_reasons(whole):
    one, two = whole.run(**ROWS), whole.run(**many(20, load=[2000.0] * 11))
    both = Estimate.stack([one, two], (2,))
    assert both.reason.tolist() == [0, 1] and both.rows_set_aside.tolist() == [0, 11]
    with pytest.raises(InputError, match="an estimate is a int"):
        fuse_estimates([one, 3])


def test_the_memory_of_another_file_or_wheel_is_refused(whole, any_set_file, wheel_set_file):
    any_wheel = Estimator.load(any_set_file)
    mine = any_wheel.on(**ANY_WHEEL)
    _, memory = mine.step(mine.start(), **ONE)
    for other in (whole, Estimator.load(wheel_set_file), any_wheel.on(**ANY_WHEEL | {"n": 1.0})):
        with pytest.raises(InputError, match="another file, version, wheel, prior") as error:
            other.step(memory, **ONE)
        assert other.path in line_of(error)
    again = Estimator.load(any_set_file).on(**ANY_WHEEL)
    found, _ = again.step(memory, **ONE)
    assert found.rows_used == 2


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"file": ""}, "another file"),
        ({"system": lambda kept: np.zeros((2, 5))}, "is damaged: its system has shape (2, 5)"),
        ({"system": lambda kept: np.full_like(kept, np.nan)}, "is damaged"),
        ({"system": lambda kept: kept * ([1, np.inf] + [1] * (kept.shape[1] - 2))}, "is damaged"),
        ({"counts": lambda kept: np.zeros(2)}, "is damaged"),
        ({"counts": lambda kept: np.full(3, np.nan)}, "is damaged"),
        ({"system": "text"}, "memory is 'text'"),
    ],
)
def test_a_changed_memory_is_refused(whole, change, said):
    _, memory = whole.step(whole.start(), **ONE)
    changed = {k: v(getattr(memory, k)) if callable(v) else v for k, v in change.items()}
    memory = replace(memory, **changed)
    with pytest.raises(InputError) as error:
        whole.step(memory, **ONE)
    assert said in line_of(error)


def test_copies_work_and_pickles_are_refused_in_one_line(whole):
    for twin in (copy.copy(whole), copy.deepcopy(whole)):
        np.testing.assert_array_equal(twin.run(**ROWS).mean, whole.run(**ROWS).mean)
    with pytest.raises(InputError, match=r"hand over its path, and load it by Estimator\.load"):
        pickle.dumps(whole)


WRONG = ["0.3", None, True, 1j, {"a": 1}, [[0.1, 0.2], [0.3]], object(), b"x", ["a"], len]
WRONG += [np.datetime64("2020-01-01"), np.ma.masked_array([0.3], [True]), {0.1, 0.2}]


@pytest.mark.parametrize("name", ["slip", "torque", "load", "sinkage", "torque_std", "torque_bias"])
def test_a_reading_of_a_wrong_type_is_refused(whole, name, subtests):
    for value in WRONG:
        with subtests.test(type(value).__name__):
            for call in (whole.run, lambda **rows: whole.step(whole.start(), **rows)):
                with pytest.raises(InputError, match=f"{name} is ") as error:
                    call(**ONE | {name: value})
                assert "needed is a number" in line_of(error)
            if name in whole.inputs:
                with pytest.raises(InputError, match=f"{name} is "):
                    whole(**ONE | {name: value})


WRONG_CALLS = {
    "path of a number": (lambda e: Estimator.load(5), "path is a int"),
    "path of bytes": (lambda e: Estimator.load(b"m.onnx"), "path is a bytes"),
    "no path": (lambda e: Estimator.load(None), "path is a NoneType"),
    "folder": (lambda e: Estimator.load("."), "cannot be read"),
    "text for a wheel": (lambda e: e.on(wheel_radius="0.1"), "wheel_radius is '0.1'"),
    "two radii": (lambda e: e.on(wheel_radius=[0.1, 0.2]), "wheel_radius has 2 elements"),
    "noise of a number": (lambda e: e.on(noise=3), "noise is a int"),
    "noise without share": (lambda e: e.on(noise={"torque": 0.1}), "noise of torque is 0.1"),
    "noise of text": (lambda e: e.on(noise={"torque": ("a", "b")}), "noise of torque is ('a',"),
    "infinite noise": (lambda e: e.on(noise={"torque": (np.inf, 0)}), "noise of torque is inf"),
    "noise of speed": (lambda e: e.on(noise={"speed": (0, 0.1)}), "noise of speed is 0 and 0.1"),
    "memory of text": (lambda e: e.step("memory", **ONE), "memory is a str"),
    "no memory": (lambda e: e.step(None, **ONE), "memory is a NoneType"),
    "negative shape": (lambda e: e.prior_estimate(-1), "shape is (-1,)"),
    "shape of text": (lambda e: e.prior_estimate("a"), "shape is ('a',)"),
    "unknown parameter": (lambda e: e.run(**ROWS)["density"], "'density' is not estimated"),
    "pickle": (pickle.dumps, "cannot be pickled"),
}


@pytest.mark.parametrize("what", WRONG_CALLS)
def test_a_wrong_argument_is_refused_in_one_line(any_set_file, whole, what):
    call, said = WRONG_CALLS[what]
    estimator = Estimator.load(any_set_file) if "wheel" in said or "radi" in what else whole
    with pytest.raises(Exception) as error:
        call(estimator)
    assert type(error.value).__module__ == "soilml.errors"
    assert said in line_of(error)
