"""The onboard runtime: estimates, flags, and files that are refused."""

import json
from pathlib import Path

import numpy as np
import onnx
import pytest
from bit_flips import flipped
from signed_files import signed

from soilml import Estimator, Model, Operating, Wheel, soil
from soilml.errors import ModelFileError
from soilml.onboard.model_file import find_model, released_models


@pytest.fixture(scope="module")
def estimator(small_model):
    return Estimator.load(small_model)


def test_answers_have_names_units_and_shapes(estimator):
    one = estimator(slip=0.3, torque=3.0, load=60.0)
    assert one.names == ("cohesion", "friction_angle", "shear_modulus")
    assert one.units == ("Pa", "rad", "m")
    assert one.mean.shape == (3,) and one.covariance.shape == (3, 3)
    assert one.in_range.shape == () and bool(one.in_range)
    np.testing.assert_allclose(np.sqrt(np.diag(one.covariance)), one.std, rtol=1e-5)
    grid = estimator(slip=np.linspace(0.1, 0.5, 5), torque=3.0, load=np.full((2, 1), 60.0))
    assert grid.mean.shape == (2, 5, 3) and grid.covariance.shape == (2, 5, 3, 3)
    np.testing.assert_allclose(grid.mean[0, 2], one.mean, rtol=1e-6)
    assert tuple(one["cohesion"]) == (one.mean[0], one.std[0])
    assert (one.low < one.mean).all() and (one.mean < one.high).all()
    # one reading tells some of the soil
    assert one.abstains.any() and (one.abstains == (one.std > 0.8 * one.prior_std)).all()


def test_readings_out_of_range_are_flagged_and_get_the_prior(estimator):
    cases = {
        "slip beyond": {"slip": 0.8, "torque": 4.0, "load": 60.0},
        "braking": {"slip": -0.2, "torque": -2.0, "load": 60.0},
        "load in kN": {"slip": 0.3, "torque": 3.0, "load": 0.06},
        "load in gram force": {"slip": 0.3, "torque": 3.0, "load": 6000.0},
        "torque of another wheel": {"slip": 0.3, "torque": 30.0, "load": 60.0},
        "torque no soil gives": {"slip": 0.06, "torque": 8.0, "load": 60.0},
    }
    for readings in cases.values():
        wild = estimator(**readings)
        assert not bool(wild.in_range)
        np.testing.assert_allclose(wild.std, estimator.prior.std, rtol=1e-6)
        np.testing.assert_allclose(wild.mean, estimator.prior.mean, rtol=1e-6)
        assert wild.abstains.all()


def test_several_rows_of_one_soil_reduce_the_uncertainty(estimator):
    rng = np.random.default_rng(0)
    slip, load = rng.uniform(0.1, 0.55, 12), rng.uniform(35.0, 110.0, 12)
    sand = soil("wong1989/dry_sand", cohesion=900.0, friction_angle=0.6, shear_modulus=0.012)
    force = Model(Wheel(radius=0.15, width=0.12))(sand, Operating(slip=slip, load=load))
    together = estimator.run(slip=slip, torque=force.torque, load=load)
    alone = estimator(slip=slip, torque=force.torque, load=load)
    assert together.mean.shape == (3,)
    assert (together.std[1:] < 0.9 * np.median(alone.std, axis=0)[1:]).all()
    assert (together.std <= estimator.prior.std * 1.0001).all()


def test_a_repeated_reading_counts_once(estimator):
    alone = estimator(slip=0.3, torque=3.0, load=60.0)
    again = estimator.run(slip=np.full(500, 0.3), torque=np.full(500, 3.0), load=np.full(500, 60.0))
    assert bool(again.in_range)
    np.testing.assert_allclose(again.std, alone.std, rtol=0.1)
    np.testing.assert_allclose(again.mean, alone.mean, atol=0.03 * alone.prior_std.min())
    run = {"slip": [0.1, 0.3, 0.5], "torque": [1.7, 3.4, 7.0], "load": [40.0, 60.0, 110.0]}
    once = estimator.run(**run)
    often = estimator.run(**{name: np.repeat(values, 20) for name, values in run.items()})
    for field in ("mean", "std", "low", "high"):
        np.testing.assert_allclose(getattr(often, field), getattr(once, field), rtol=0.02)


def test_files_of_another_origin_are_refused(tmp_path, small_model):
    whole = small_model.read_bytes()
    files = {
        "none.onnx": None,
        "empty.onnx": b"",
        "cut.onnx": whole[: len(whole) // 2],
        "text.onnx": b"a model, honestly",
    }
    for name, content in files.items():
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(ModelFileError) as caught:
            Estimator.load(tmp_path / name)
        assert name in str(caught.value) and "\n" not in str(caught.value)
    foreign = onnx.load(small_model)
    del foreign.metadata_props[:]
    onnx.save(foreign, tmp_path / "foreign.onnx")
    with pytest.raises(ModelFileError, match="without soilml metadata"):
        Estimator.load(tmp_path / "foreign.onnx")


def test_every_single_damaged_byte_is_found(tmp_path, small_model):
    whole = small_model.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(60):
        (tmp_path / "damaged.onnx").write_bytes(flipped(whole, rng))
        with pytest.raises(ModelFileError) as caught:
            Estimator.load(tmp_path / "damaged.onnx")
        assert "\n" not in str(caught.value)


def test_the_probe_detects_a_runtime_with_other_results(estimator, tmp_path, small_model):
    probe = json.loads(estimator.metadata["probe"])
    probe[0]["mean"][0][0] += 1.0
    with pytest.raises(ModelFileError, match="fails its own probe"):
        Estimator.load(signed(small_model, tmp_path / "other.onnx", probe=json.dumps(probe)))


def test_a_short_name_is_a_file_or_a_released_one(workplace):
    assert find_model("wheel") == released_models()["wheel"]
    for path in ("folder/wheel", "wheel.onnx", Path("folder") / "wheel"):
        assert find_model(path) == Path(path)  # that it is missing is said when it is opened
    Path("wheel").touch()
    assert find_model("wheel") == Path("wheel")
