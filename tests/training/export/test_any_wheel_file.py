"""Specs of a file for wheels of any size."""

import pytest

from datagen.recipe import packaged_file
from soilml import Estimator
from training import train
from training.export.any_wheel_file import export_any_wheel
from training.spec import read_any_wheel_spec

SPEC = packaged_file("any_wheel", "training", "specs").read_text()


def spec_of(folder, text):
    path = folder / "spec.toml"
    path.write_text(text)
    return path


def test_a_file_has_the_errors_of_sensors_that_its_spec_states(
    tmp_path, any_posterior, monkeypatch
):
    """With a response that is fitted already, and no figures of a card."""
    monkeypatch.setattr(train, "fit_response", lambda *_: any_posterior.response)
    monkeypatch.setattr(train, "calibrate_misfit_limits", lambda *_: any_posterior)
    monkeypatch.setattr(train, "validate_posterior", lambda *_: {})
    text = f"{SPEC}\n[set_posterior.sensor_errors]\nslip_bias = 0.004\ntorque_gain = 0\n"
    usual_spec, spec = (
        read_any_wheel_spec("any_wheel"),
        read_any_wheel_spec(spec_of(tmp_path, text)),
    )
    stds = {}
    for name, own in {"usual": usual_spec, "stated": spec}.items():
        posterior, _ = train.train_any_wheel(own, lambda *_: None)
        export_any_wheel(own, posterior, {}, tmp_path / f"{name}.onnx")
        rover = Estimator.load(tmp_path / f"{name}.onnx").on(
            wheel_radius=0.15, wheel_width=0.12, bearing_modulus=1.53e6, n=1.1,
            bearing_std=0.1, cohesion_max=3000.0, shear_modulus_max=0.03,
        )  # fmt: skip
        exact = rover.on(slip_bias=0.004, torque_gain=0.0)
        readings = {"slip": [0.1, 0.3, 0.5], "torque": [1.5, 4.1, 6.6], "load": [40.0, 60.0, 80.0]}
        stds[name] = [answers.run(**readings).std for answers in (rover, exact)]
    assert stds["stated"][0] == pytest.approx(stds["stated"][1], rel=1e-6)
    assert stds["stated"][0] == pytest.approx(stds["usual"][1], rel=1e-6)
    assert stds["stated"][0] != pytest.approx(stds["usual"][0], rel=1e-2)
