"""Rows that torch solves on a device give the answers of numpy."""

import numpy as np
import pyarrow.parquet as pq
import pytest
import torch

from soilml import EFFECTS, Model, Operating, Wheel, soil
from soilml.cli import main
from soilml.errors import InputError
from soilml.physics import model as model_module
from soilml.physics.computing_device import computing_on, current_device

SAND = soil("wong1989/dry_sand")
DEVICES = [
    "cpu",
    pytest.param(
        "cuda", marks=pytest.mark.skipif(not torch.cuda.is_available(), reason="torch sees no GPU")
    ),
]


@pytest.mark.parametrize("device", DEVICES)
def test_a_device_gives_the_answers_of_numpy(device):
    rng = np.random.default_rng(1)
    model = Model(Wheel(radius=0.15, width=0.12)) + EFFECTS["slip-sinkage"](n1=0.3)
    at = Operating(slip=rng.uniform(-0.5, 0.8, 5000), load=rng.uniform(20.0, 150.0, 5000))
    expected = model(SAND, at)
    with computing_on(device):
        assert current_device() == device
        found = model(SAND, at)
    assert current_device() is None
    for name in ("torque", "drawbar_pull", "sinkage", "entry_angle"):
        values = getattr(found, name)
        assert isinstance(values, np.ndarray) and values.dtype == np.float64
        np.testing.assert_allclose(values, getattr(expected, name), rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(found.status, expected.status)


@pytest.mark.parametrize("device", DEVICES)
def test_generate_on_a_device(device, tmp_path, monkeypatch):
    used = []
    moved = model_module.to_device
    monkeypatch.setattr(model_module, "to_device", lambda *a: used.append(a[1]) or moved(*a))
    common = ["--rows", "3000", "--seed", "4"]
    assert main(["generate", "wheel", str(tmp_path / "a.parquet"), *common]) == 0
    out = str(tmp_path / "b.parquet")
    assert main(["generate", "wheel", out, *common, "--device", device]) == 0
    assert set(used) == {device}
    first, second = (pq.read_table(tmp_path / f"{name}.parquet") for name in "ab")
    assert first.schema.equals(second.schema, check_metadata=True)
    for name in first.column_names:
        one, other = first[name].to_numpy(), second[name].to_numpy()
        if one.dtype.kind == "f":
            np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-12)
        else:
            assert (one == other).all()


@pytest.mark.parametrize("device", ["warp", "cuda:99", "meta:x"])
def test_a_device_that_is_not_there_is_refused_in_one_line(device, tmp_path, capsys):
    out = tmp_path / "data.parquet"
    assert main(["generate", "wheel", str(out), "--rows", "10", "--device", device]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "it sees: cpu" in said
    assert not out.exists()


def test_a_device_without_memory_is_refused_in_one_line(monkeypatch):
    def full(*_):
        raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB")

    monkeypatch.setattr(model_module, "to_device", full)
    with pytest.raises(InputError, match="memory of cpu does not suffice"), computing_on("cpu"):
        Model(Wheel(radius=0.15, width=0.12))(SAND, Operating(slip=np.asarray([0.1]), load=60.0))
