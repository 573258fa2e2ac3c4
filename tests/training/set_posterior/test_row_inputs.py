"""A graph fed by a caller that has onnxruntime alone: defaults, broadcasting, failing sensors."""

import numpy as np
import onnxruntime as ort
import pytest
from conftest import FILE_NOISE
from simulated_rows import ANY_WHEEL

from soilml import Estimator
from soilml.onboard.set_contract import ABSENT_STD, MEMORY_INPUTS, READING_INPUTS, STD_INPUTS
from training.onnx_graph.builder import FLOAT, Graph, session_of
from training.onnx_graph.value import Value
from training.set_posterior.residual_system import MOST_PULL_NOISE
from training.set_posterior.row_inputs import ROW_STDS, complete_inputs, default_values

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


@pytest.fixture(scope="module")
def single(whole_file):
    return Bare(whole_file)


@pytest.fixture(scope="module")
def any_wheel(any_set_file):
    return Bare(any_set_file, **{name: [value] for name, value in ANY_WHEEL.items()})


def completed(noise, **feed):
    """What the graph makes of inputs by row, by name."""
    graph = Graph()
    names = (*READING_INPUTS, *ROW_STDS, *MEMORY_INPUTS)
    complete = complete_inputs({name: Value(graph, name) for name in names}, (), noise)
    for name in names:
        of_rows = name not in MEMORY_INPUTS
        value = complete[name].reshape(-1) if of_rows else complete[name]
        value.node("Identity").named(f"{name}_out")
    shapes = {name: ["rows"] for name in names} | {"memory": ["kept", 3], "counted": [3]}
    outputs = {f"{name}_out": (FLOAT, shape) for name, shape in shapes.items()}
    inputs = {name: ["n"] for name in names} | {"memory": ["kept", 3], "counted": [3]}
    session = session_of(graph.model(inputs, outputs))
    memory = {"memory": np.zeros((0, 3), np.float32), "counted": np.zeros(3, np.float32)}
    given = {name: np.asarray(value, np.float32) for name, value in feed.items()}
    return dict(zip(names, session.run(None, default_values() | memory | given), strict=True))


@pytest.mark.parametrize("reading", [1e13, -1e25, 3e38])
def test_a_channel_larger_than_any_sensor_gives_is_inconsistent(any_wheel, reading):
    stds = {"drawbar_pull_std": [0.5], "sinkage_std": [0.001]}
    found = any_wheel(**ROWS, drawbar_pull=[1.0, 2.0, reading, 3.0], **stds)
    assert_finite(found)
    assert not found["set_in_range"][0] and found["counted_out"].tolist() == [8.0, 4.0, 4.0]


def test_a_torque_that_was_not_measured_is_left_out(sets):
    found = sets(**with_change("torque", 1, -1e30))
    assert found["counted_out"].tolist() == [3.0, 4.0, 4.0]
    kept = {name: np.delete(values, 1) for name, values in ROWS.items()}
    expected = sets(**kept)
    assert_same({name: found[name] for name in SETS}, expected, 1e-4)


def test_what_is_not_measured_has_no_weight_under_any_load():
    rows = {"slip": [0.3] * 4, "load": [60.0, 1e3, 1e4, 1e6], "torque": [5.0]}
    noise = {"torque": [0.1, 0.02], "drawbar_pull": [0.5, 0.0]}
    for pull in ({}, {"drawbar_pull": [1.0], "drawbar_pull_std": [ABSENT_STD]}):
        found = completed(noise, **rows, **pull)
        assert (found["drawbar_pull_std"] / found["load"] > 1e3 * MOST_PULL_NOISE).all()
        assert (found["drawbar_pull"] == 1.0).all()
        np.testing.assert_allclose(found["torque_std"], np.hypot(0.1, 0.1), rtol=1e-6)
        assert (found["torque_bias"] == 0.0).all()
    given = completed(noise, **rows, drawbar_pull=[1.0, 2.0, 3.0, -4.0])
    np.testing.assert_allclose(given["drawbar_pull_std"], 0.5)
    assert given["drawbar_pull"].tolist() == [1.0, 2.0, 3.0, -4.0]
    assert (completed(noise, **rows, sinkage=[0.01])["sinkage_std"] > 1e6).all()  # without noise


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


def test_a_negative_standard_deviation_and_zero_are_the_noise_of_the_file(sets):
    found = sets(**ROWS)
    for value in (-1.0, 0.0):
        assert_same(found, sets(**ROWS, torque_std=[value]))
    assert_same(found, sets(**ROWS, torque_bias=[-1.0]))
    unbiased = sets(**ROWS, torque_bias=[0.0])
    assert np.linalg.det(unbiased["set_covariance"]) < np.linalg.det(found["set_covariance"])


def test_a_channel_that_is_fed_has_the_noise_of_the_file_or_none(sets, whole_file):
    sinkage = np.asarray([0.01, 0.015, 0.022, 0.014])
    found = sets(**ROWS, sinkage=sinkage)
    assert found["counted_out"].tolist() == [8.0, 4.0, 4.0]
    own = Estimator.load(whole_file).run(**ROWS, sinkage=sinkage)
    np.testing.assert_allclose(found["set_std"], own.std, rtol=1e-3)
    pull = sets(**ROWS, drawbar_pull=[3.0] * 4)  # the file has no noise of the drawbar pull
    assert_same(pull, sets(**ROWS))
    some = np.where([True, False, True, False], sinkage, -1e30)
    assert sets(**ROWS, sinkage=some)["counted_out"].tolist() == [6.0, 4.0, 4.0]


def test_one_element_holds_for_all_rows(sets, single):
    one = ROWS | {"load": [60.0]}
    full = ROWS | {"load": [60.0] * 4}
    stds = {"torque_std": [0.08], "torque_bias": [0.01], "sinkage": [0.01], "sinkage_std": [0.002]}
    assert_same(sets(**one, **stds), sets(**full, **{k: v * 4 for k, v in stds.items()}))
    assert_same(single(**one), single(**full))
    assert single(**one)["mean"].shape == (4, 3)


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


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["slip", "load", "torque"])
def test_single_readings_that_are_not_finite_are_out_of_range(single, name, value):
    found = single(**with_change(name, 1, value))
    assert_finite(found)
    assert not found["in_range"][1]
    expected = single(**ROWS)
    for output in ("mean", "std", "covariance", "in_range"):
        np.testing.assert_allclose(found[output][[0, 2, 3]], expected[output][[0, 2, 3]], rtol=1e-6)


@pytest.mark.parametrize("load", [0.0, -1.0, 1e-40, 3e38])
@pytest.mark.parametrize("torque", [0.0, 3e38])
def test_loads_and_torques_of_any_size_give_finite_numbers(sets, single, any_wheel, load, torque):
    for run in (sets, single, any_wheel):
        found = run(slip=[0.3], torque=[torque], load=[load])
        assert_finite(found)
        assert not found.get("row_in_range", found.get("in_range")).any()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1.0, 0.0])
@pytest.mark.parametrize("name", [name for name in ANY_WHEEL if name != "bearing_std"])
def test_an_impossible_wheel_is_out_of_range(any_wheel, name, value):
    found = any_wheel(**ROWS, **{name: [value]})
    assert_finite(found)
    assert not found["set_in_range"][0]


def test_any_wheel_needs_its_wheel_and_nothing_else(any_wheel, any_set_file):
    found = any_wheel(**ROWS)
    own = Estimator.load(any_set_file).on(**ANY_WHEEL).run(**ROWS)
    np.testing.assert_allclose(found["set_mean"], own.mean, rtol=1e-4)
    with pytest.raises(Exception, match="wheel_radius"):
        Bare(any_set_file)(**ROWS)


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


@pytest.mark.parametrize("seed", range(3))
def test_no_input_gives_an_output_that_is_not_finite(sets, single, any_wheel, seed):
    rng = np.random.default_rng(seed)

    def of_any_size(count):
        values = rng.choice([-1.0, 1.0, 1.0], count) * 10.0 ** rng.uniform(-45.0, 38.5, count)
        special = rng.choice([0.0, -1.0, 1.0, 1e6, -1e30, np.nan, np.inf, -np.inf], count)
        return np.where(rng.random(count) < 0.4, special, values).astype(np.float32)

    names = (*READING_INPUTS, *STD_INPUTS)
    for _ in range(120):
        rows = {name: np.tile(np.asarray(values, np.float32), 3) for name, values in ROWS.items()}
        for name in map(str, rng.choice(names, 3, replace=False)):
            values = np.full(12, 0.05, np.float32) if name not in rows else rows[name]
            rows[name] = np.where(rng.random(12) < 0.2, of_any_size(12), values)
        assert_finite(sets(**rows))
        assert_finite(single(**{name: rows[name] for name in ROWS}))
        wheel = {name: of_any_size(1) for name in rng.choice(list(ANY_WHEEL), 2, replace=False)}
        assert_finite(any_wheel(**rows, **wheel))
