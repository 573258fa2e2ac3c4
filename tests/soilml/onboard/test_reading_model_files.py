"""What is refused before a file's checksums are compared."""

import os

import onnx
import pytest
from compiled_c import ROOT

import soilml.onboard.model_file as model_file
from soilml import Estimator
from soilml.errors import ModelFileError

WHEEL = ROOT / "exported" / "wheel_linear.onnx"


def message(path):
    with pytest.raises(ModelFileError) as caught:
        Estimator.load(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("key", ["soilml_format", "soilml_interface"])
@pytest.mark.parametrize("text", ["9" * 10_000, "\x1b[31m\n", "\u00b2", "0", ""])
def test_a_version_of_any_text_is_refused(tmp_path, key, text):
    model = onnx.load(WHEEL)
    next(e for e in model.metadata_props if e.key == key).value = text
    (tmp_path / "m.onnx").write_bytes(model.SerializeToString(deterministic=True))
    said = message(tmp_path / "m.onnx")
    assert f"has {key.removeprefix('soilml_')} " in said and said.isprintable() and len(said) < 400


def test_devices_and_pipes_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.onnx")
    for path in ("/dev/zero", tmp_path / "pipe.onnx"):
        assert "is a device or a pipe" in message(path)
    assert "Is a directory" in message(tmp_path)


def test_a_file_that_is_too_large_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(model_file, "MOST_BYTES", 3 << 20)
    with (tmp_path / "m.onnx").open("wb") as opened:
        opened.truncate((4 << 20) + 1)
    assert "has 4 MB; a model file has at most 3 MB" in message(tmp_path / "m.onnx")
