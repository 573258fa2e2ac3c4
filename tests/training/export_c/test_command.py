"""The command `soilml export-c`: what it writes, says and refuses."""

import re

import numpy as np
import onnx
import pytest
from compiled_c import ROOT
from onnx import helper

from soilml.cli import main
from soilml.errors import ModelFileError
from training.export_c.c_file import write_c

LINEAR = ROOT / "exported" / "wheel_linear.onnx"


def refused(words, capsys, said):
    assert main(["export-c", *map(str, words)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and said in error


def test_both_files_are_written_and_their_memory_is_said(tmp_path, capsys):
    out = tmp_path / "linear.c"
    assert main(["export-c", str(LINEAR), str(out)]) == 0
    header = out.with_suffix(".h").read_text()
    work = re.search(r"#define LINEAR_WORK_BYTES (\d+)", header)
    assert work and f"working memory {work[1]}" in capsys.readouterr().err
    assert '#include "linear.h"' in out.read_text()
    assert not [p for p in tmp_path.iterdir() if p.name not in ("linear.c", "linear.h")]


def test_a_name_with_a_newline_stays_on_one_line(tmp_path, capsys):
    folder = tmp_path / "a\nb\x1b"
    folder.mkdir()
    assert main(["export-c", str(LINEAR), str(folder / "linear.c")]) == 0
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and r"a\nb\x1b/linear.h" in said and "\x1b" not in said
    refused([LINEAR, tmp_path / "no\nsuch" / "linear.c"], capsys, r"no\nsuch does not exist")
    refused([LINEAR, tmp_path / "lin\near.c"], capsys, r"lin\near.c: ")
    refused([LINEAR, tmp_path / "linear\n.h"], capsys, r"linear\n.h: ")


def test_a_file_without_sets_has_no_functions_of_sets(tmp_path):
    out = tmp_path / "linear.c"
    assert main(["export-c", str(LINEAR), str(out)]) == 0
    header = out.with_suffix(".h").read_text()
    assert "int linear_single(" in header and "set_step" not in header


def test_the_same_file_gives_the_same_bytes(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        assert main(["export-c", str(LINEAR), str(tmp_path / folder / "linear.c")]) == 0
    first, second = ((tmp_path / folder / "linear.c").read_bytes() for folder in ("a", "b"))
    assert first == second


@pytest.mark.parametrize("name", ["1wheel.c", "Wheel.c", "my-wheel.c", "wheel v2.c"])
def test_a_name_that_c_does_not_take_is_refused(name, tmp_path, capsys):
    refused([LINEAR, tmp_path / name], capsys, "begins the names of the C functions")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["math.c", "string.c", "stdbool.c"])
def test_a_name_that_would_hide_a_header_of_the_library_is_refused(name, tmp_path, capsys):
    refused([LINEAR, tmp_path / name], capsys, "would hide <")
    assert not list(tmp_path.iterdir())


def test_other_bad_input_is_refused(tmp_path, capsys):
    out = tmp_path / "wheel.c"
    refused([LINEAR, tmp_path / "wheel.txt"], capsys, "must end in .c")
    assert main(["export-c", str(LINEAR), str(out), "--rows", "0"]) == 2
    assert "--rows: '0' given; needed" in capsys.readouterr().err
    refused([tmp_path / "none.onnx", out], capsys, "there is no such file")
    (tmp_path / "text.onnx").write_text("no model")
    refused([tmp_path / "text.onnx", out], capsys, "not a valid ONNX model")
    assert not out.exists()


def test_an_operator_that_is_not_known_is_named():
    model = onnx.load(str(LINEAR))
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    node = next(n for n in model.graph.node if n.op_type == "Abs")
    node.op_type = "Sign"
    with pytest.raises(ModelFileError, match="operator Sign is not known to export-c"):
        write_c(model, metadata, "linear", "linear.onnx")


def test_a_memory_that_does_more_than_grow_is_refused():
    model = onnx.load(str(ROOT / "exported" / "any_wheel.onnx"))
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    half = onnx.numpy_helper.from_array(np.float32(0.5), "half")
    model.graph.initializer.append(half)
    for node in model.graph.node:
        node.input[:] = ["faded" if name == "memory" else name for name in node.input]
    model.graph.node.insert(0, helper.make_node("Mul", ["memory", "half"], ["faded"]))
    with pytest.raises(ModelFileError, match="this graph changes earlier rows"):
        write_c(model, metadata, "any_wheel", "any_wheel.onnx")
