"""Campaigns of few rows: all rows are learned from, and each is judged by a fit without its run."""

from __future__ import annotations

import numpy as np
import pytest

from soilml import Estimator
from soilml.onboard.multi_sensor import fuse_estimates
from training.dataset import read_dataset
from training.export.model_card import model_card
from training.export.model_file import export_model
from training.spec import read_spec
from training.train import train


def strides(path, soils, rows, seed, soil_std=0.05):
    """A campaign: slip is linear in torque over load and in vibration, shifted by soil."""
    rng = np.random.default_rng(seed)
    run = np.repeat(np.arange(soils), rows)
    slip = rng.uniform(0.0, 0.6, soils * rows)
    load = rng.uniform(15.0, 35.0, soils * rows)
    shift = np.repeat(rng.normal(0.0, soil_std, soils), rows)
    torque = load * (0.05 + 0.1 * (slip + shift + rng.normal(0.0, 0.04, slip.size)))
    vibration = 1.0 + 10.0 * (slip + rng.normal(0.0, 0.05, slip.size))
    columns = {
        "run": run, "slip": slip, "load_N": load, "torque_Nm": torque, "vibration_m_s2": vibration,
    }  # fmt: skip
    values = np.stack(list(columns.values()), axis=1)
    np.savetxt(path, values, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path


def trained_on(path, name="slip_torque"):
    spec = read_spec(name)
    return train(spec, read_dataset(path, spec.features, spec.targets))


@pytest.mark.parametrize(("soils", "rows"), [(20, 1), (60, 1), (4, 15)])
def test_intervals_of_few_rows_hold_for_other_soils(tmp_path, soils, rows):
    """The mean coverage over campaigns is near 90 %."""
    test = read_dataset(strides(tmp_path / "t.csv", 400, 1, 99), *features_of("slip_torque"))
    held = []
    for seed in range(24):
        trained = trained_on(strides(tmp_path / "c.csv", soils, rows, seed))
        mean, std, inside = trained.predict(test.features)
        near = np.abs(test.targets - mean) <= trained.left_out.factor * std
        held.append(near[inside].mean())
        assert inside.mean() > 0.7
    assert 0.85 <= np.mean(held) <= 0.95


def features_of(name):
    spec = read_spec(name)
    return spec.features, spec.targets


def test_files_of_few_rows_are_exported_and_fused_by_their_correlation(tmp_path):
    path = strides(tmp_path / "a.csv", 4, 15, 7)
    files = []
    for name in ("slip_torque", "slip_vibration"):
        trained = trained_on(path, name)
        metadata = export_model(trained, tmp_path / f"{name}.onnx", path)
        card = model_card(trained, metadata, name)
        assert "campaign of few rows" in card and "60, all for training" in card
        files.append(Estimator.load(tmp_path / f"{name}.onnx"))
    assert [len(f.errors.rows) for f in files] == [60, 60]
    readings = files[0](torque=2.1, load=25.0), files[1](vibration=4.0, load=25.0)
    fused = fuse_estimates(readings)
    assert fused.used.all()
    assert fused.estimate.std[0] < min(e.std[0] for e in readings)
