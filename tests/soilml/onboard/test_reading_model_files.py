"""Model files as they are opened: names, sizes, and files that refer to others."""

import os

import onnx
import pytest
from onnx.external_data_helper import set_external_data
from signed_files import signed

import soilml.onboard.model_file as model_file
from soilml import Estimator
from soilml.errors import ModelFileError
from soilml.onboard.model_file import refers_to_files
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


def test_weights_in_another_file_are_refused(small_model, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model = onnx.load(small_model)
    tensor = max(model.graph.initializer, key=lambda tensor: len(tensor.raw_data))
    (tmp_path / "weights").write_bytes(tensor.raw_data)
    assert not refers_to_files(small_model.read_bytes())
    set_external_data(tensor, "weights")
    tensor.ClearField("raw_data")
    assert refers_to_files(signed(model, tmp_path / "m.onnx").read_bytes())
    with pytest.raises(ModelFileError, match="weights in other files"):
        Estimator.load("m.onnx")


def test_tensors_are_found_wherever_the_format_has_them():
    outside = onnx.TensorProto(data_location=onnx.TensorProto.EXTERNAL)
    inside = onnx.TensorProto(float_data=[1.0, 2.0], name="inside")

    def graph(tensor):
        return onnx.GraphProto(name="g", initializer=[tensor])

    def model(tensor):
        attributes = [
            onnx.AttributeProto(name="a", t=tensor),
            onnx.AttributeProto(name="a", tensors=[inside, tensor]),
            onnx.AttributeProto(name="a", g=graph(tensor)),
            onnx.AttributeProto(name="a", graphs=[graph(inside), graph(tensor)]),
            onnx.AttributeProto(name="a", sparse_tensor=onnx.SparseTensorProto(values=tensor)),
        ]
        nodes = [onnx.NodeProto(op_type="Constant", attribute=[a]) for a in attributes]
        yield onnx.ModelProto(graph=graph(tensor))
        sparse = [onnx.SparseTensorProto(values=inside, indices=tensor)]
        yield onnx.ModelProto(graph=onnx.GraphProto(sparse_initializer=sparse))
        for node in nodes:
            yield onnx.ModelProto(graph=onnx.GraphProto(node=[node]))
            yield onnx.ModelProto(functions=[onnx.FunctionProto(name="f", node=[node])])

    for found in model(outside):
        assert refers_to_files(found.SerializeToString())
    for found in model(inside):
        assert not refers_to_files(found.SerializeToString())


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
