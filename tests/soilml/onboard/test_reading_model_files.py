"""Model files as they are opened: names, sizes, and files that refer to others."""

import os

import onnx
import pytest
from onnx.external_data_helper import set_external_data
from signed_files import signed

import soilml.onboard.model_file as model_file
from soilml import Estimator
from soilml.errors import ModelFileError
from soilml.onboard.set_contract import INTERFACE


def message(path):
    with pytest.raises(ModelFileError) as caught:
        Estimator.load(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


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


def test_weights_in_another_file_are_refused(small_model, workplace):
    model = onnx.load(small_model)
    tensor = max(model.graph.initializer, key=lambda tensor: len(tensor.raw_data))
    (workplace / "weights").write_bytes(tensor.raw_data)
    set_external_data(tensor, "weights")
    tensor.ClearField("raw_data")
    signed(model, workplace / "m.onnx")
    with pytest.raises(ModelFileError, match="weights in other files"):
        Estimator.load("m.onnx")


def test_a_word_of_the_metadata_is_no_other_file(small_model, tmp_path):
    signed(small_model, tmp_path / "m.onnx", note="its location")
    assert Estimator.load(tmp_path / "m.onnx").metadata["note"] == "its location"


def test_tensors_of_other_files_are_refused_wherever_they_are():
    outside = onnx.TensorProto(name="w", data_type=1, dims=[2], raw_data=bytes(8))
    set_external_data(outside, "weights")
    for attribute in (
        onnx.AttributeProto(name="a", t=outside),
        onnx.AttributeProto(name="a", sparse_tensor=onnx.SparseTensorProto(values=outside)),
        onnx.AttributeProto(name="a", g=onnx.GraphProto(name="g", initializer=[outside])),
    ):
        node = onnx.NodeProto(op_type="Constant", attribute=[attribute])
        for model in (
            onnx.ModelProto(graph=onnx.GraphProto(node=[node])),
            onnx.ModelProto(functions=[onnx.FunctionProto(name="f", node=[node])]),
        ):
            with pytest.raises(ValueError, match="weights in other files"):
                model_file.create_session(model.SerializeToString())


@pytest.mark.parametrize(
    ("interface", "refused"), [("1", False), ("4", False), ("5", False), ("6", True), ("5b", True)]
)
def test_a_file_of_a_later_interface_is_refused(small_model, tmp_path, interface, refused):
    assert Estimator.load(small_model).metadata["soilml_interface"] == INTERFACE == "5"
    signed(small_model, tmp_path / "m.onnx", soilml_interface=interface)
    if refused:
        with pytest.raises(ModelFileError, match=f"has interface {interface}; this version of"):
            Estimator.load(tmp_path / "m.onnx")
    else:
        assert Estimator.load(tmp_path / "m.onnx").metadata["soilml_interface"] == interface
