"""The command `soilml export-c`: what it writes, says and refuses."""

import re

import onnx
import pytest
from compiled_c import ROOT
from console import refused

from soilml.cli import main
from soilml.errors import ModelFileError
from training.export_c.c_file import write_c

LINEAR = ROOT / "exported" / "wheel_linear.onnx"


def test_both_files_are_written_and_their_memory_is_said(tmp_path, capsys):
    out = tmp_path / "linear.c"
    assert main(["export", "c", str(LINEAR), str(out)]) == 0
    header = out.with_suffix(".h").read_text()
    work = re.search(r"#define LINEAR_WORK_BYTES (\d+)", header)
    assert work and f"working memory {work[1]}" in capsys.readouterr().err
    assert '#include "linear.h"' in out.read_text()
    assert not [p for p in tmp_path.iterdir() if p.name not in ("linear.c", "linear.h")]


@pytest.mark.parametrize("name", ["1wheel.c", "Wheel.c", "my-wheel.c", "wheel v2.c"])
def test_a_name_that_c_does_not_take_is_refused(name, tmp_path, capsys):
    refused(
        ["export", "c", LINEAR, tmp_path / name],
        capsys,
        "begins the names of the C functions",
        tmp_path,
    )


@pytest.mark.parametrize("name", ["math.c", "string.c", "stdbool.c"])
def test_a_name_that_would_hide_a_header_of_the_library_is_refused(name, tmp_path, capsys):
    refused(["export", "c", LINEAR, tmp_path / name], capsys, "would hide <", tmp_path)


def test_an_operator_that_is_not_known_is_named():
    model = onnx.load(str(LINEAR))
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    node = next(n for n in model.graph.node if n.op_type == "Abs")
    node.op_type = "Sign"
    with pytest.raises(ModelFileError, match="operator Sign is not known to export c"):
        write_c(model, metadata, "linear", "linear.onnx")
