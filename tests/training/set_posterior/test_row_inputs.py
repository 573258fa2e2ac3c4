"""A graph fed by a caller that has onnxruntime alone: defaults, broadcasting, failing sensors."""

import numpy as np
import onnxruntime as ort
import pytest
from conftest import FILE_NOISE

from soilml import Estimator

READINGS = {"slip": [0.1, 0.3, 0.5, 0.4], "load": [40.0, 60.0, 80.0, 50.0]}
ROWS = READINGS | {"torque": [1.3, 3.1, 5.0, 2.9]}
SETS = ("set_mean", "set_std", "set_covariance", "set_low", "set_high")


class Bare:
    """A session of a file, with the outputs by name."""

    def __init__(self, path, **always):
        self.session = ort.InferenceSession(path, providers=["CPUExecutionProvider"])
        self.names = [output.name for output in self.session.get_outputs()]
        self.always = always

    def __call__(self, **feed):
        kinds = {"joint": np.bool_}
        given = {
            name: np.asarray(value, kinds.get(name, np.float32))
            for name, value in (self.always | feed).items()
        }
        return dict(zip(self.names, self.session.run(self.names, given), strict=True))


@pytest.fixture(scope="module")
def sets(whole_file):
    return Bare(whole_file, joint=[True])


def assert_same(one, other, tolerance=1e-5):
    for name, values in one.items():
        np.testing.assert_allclose(values, other[name], rtol=tolerance, atol=1e-7, err_msg=name)


def assert_finite(outputs):
    for name, values in outputs.items():
        assert np.isfinite(values).all(), name


def with_change(name, row, value):
    """The rows with one value replaced, as full columns."""
    columns = {key: np.asarray(values, np.float32).copy() for key, values in ROWS.items()}
    columns.setdefault(name, np.full(4, 0.05, np.float32))[row] = value
    return columns


def test_what_is_left_out_is_the_noise_of_the_file(sets, whole_file):
    found = sets(**ROWS)
    own = Estimator.load(whole_file).run(**ROWS)
    assert found["set_in_range"][0] and own.in_range
    np.testing.assert_allclose(found["set_mean"], own.mean, rtol=1e-4)
    np.testing.assert_allclose(found["set_std"], own.std, rtol=1e-4)
    torque = np.asarray(ROWS["torque"])
    stated = {
        "torque_std": np.hypot(FILE_NOISE["torque"][0], FILE_NOISE["torque"][1] * torque),
        "torque_bias": FILE_NOISE["torque_bias"][1] * torque,
    }
    assert_same(found, sets(**ROWS, **stated), 1e-4)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    "name", ["slip", "load", "torque", "sinkage", "drawbar_pull", "torque_std", "torque_bias"]
)
def test_a_row_that_is_not_finite_takes_no_part(sets, name, value):
    clean = with_change(name, 3, 0.05)
    kept = {key: values[:3] for key, values in clean.items()}
    kept = {k: np.tile(v, 4) for k, v in kept.items()}  # twelve rows, of which one may be out
    broken = {k: np.append(v, clean[k][3]) for k, v in kept.items()}
    broken[name][-1] = value
    found, expected = sets(**broken), sets(**kept)
    assert found["row_in_range"].tolist() == [True] * 12 + [False]
    assert_finite(found)
    assert found["counted_out"].tolist()[1:] == [13.0, 12.0]
    assert_same({n: found[n] for n in SETS}, expected)
    alone = sets(**{k: v[-1:] for k, v in broken.items()})
    assert_finite(alone)
    assert not alone["set_in_range"][0]


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_damaged_memory_is_refused_for_good(sets, value):
    found = sets(**ROWS)
    memory = {"memory": found["memory_out"].copy(), "counted": found["counted_out"]}
    memory["memory"][2, 1] = value
    for _ in range(2):
        found = sets(**ROWS, **memory)
        assert_finite(found)
        assert not found["set_in_range"][0]
        memory = {"memory": found["memory_out"], "counted": found["counted_out"]}
