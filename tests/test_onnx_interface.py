"""The interface control document of the exported files, against their signatures."""

import json
import re
from collections import namedtuple
from pathlib import Path

import numpy as np
import onnxruntime as ort
import pytest

from soilml.onboard import Estimator, Reason
from soilml.onboard.memory import MEMORY_FORMAT
from soilml.onboard.model_file import FORMAT
from soilml.onboard.set_contract import INTERFACE

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/reference/onnx.md").read_text()
RELEASED = {
    "wheel": "whole",
    "wheel_small": "whole",
    "kls1_wheel": "whole",
    "any_wheel": "set",
    "any_wheel_small": "set",
    "wheel_lssvm": "single",
    "wheel_mlp": "single",
    "wheel_linear": "single",
}


Entry = namedtuple("Entry", "kinds shape type default")
#: An item such as "- `slip_std`, `load_std` (rows), default -1: text".
ENTRY = re.compile(r"^- ((?:`\w+`(?:, )?)+) \((.*?)\)(?: (bool))?(?:, default (.*?))?: ", re.M)


def section(heading):
    return PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]


def table(heading, first):
    """Rows of the table below a heading whose first column has this name, as dicts."""
    lines = [line for line in section(heading).splitlines() if line.startswith("|")]
    cells = [[cell.strip(" `") for cell in line[1:-1].split("|")] for line in lines]
    head, _, *rows = cells
    assert head[0] == first
    return [dict(zip(head, row, strict=True)) for row in rows]


def entries(heading):
    """Inputs or outputs of the page: `(kinds, shape, type, default)` by name, as a list."""
    found = []
    for part in section(heading).split("\n**")[1:]:
        kinds = re.findall(r"\w+", part.partition("files**")[0].lower())
        for names, shape, kept, default in ENTRY.findall(part):
            for name in re.findall(r"\w+", names):
                found.append((name, Entry(kinds, shape.split(", "), kept or "float", default)))
    return found


INPUTS, OUTPUTS = entries("Inputs"), entries("Outputs")


def of_kind(found, kind):
    return {name: one for name, one in found if {kind, "all"} & set(one.kinds)}


@pytest.fixture(scope="module")
def files(whole_file, any_set_file, small_model):
    return {"whole": whole_file, "set": any_set_file, "single": small_model}


@pytest.mark.parametrize("kind", ["single", "whole", "set"])
def test_inputs_and_outputs_are_those_of_the_files(files, kind):
    session = ort.InferenceSession(files[kind], providers=["CPUExecutionProvider"])
    inputs = session.get_inputs() + session.get_overridable_initializers()
    for documented, found in (
        (of_kind(INPUTS, kind), inputs),
        (of_kind(OUTPUTS, kind), session.get_outputs()),
    ):
        assert set(documented) == {value.name for value in found}
        for value in found:
            entry = documented[value.name]
            assert value.type == f"tensor({entry.type})", value.name
            assert len(value.shape) == len(entry.shape), value.name
    required = {name for name, one in of_kind(INPUTS, kind).items() if not one.default}
    assert required == {value.name for value in session.get_inputs()}


@pytest.mark.parametrize("kind", ["whole", "set"])
def test_outputs_have_the_shapes_of_the_page(files, kind):
    session = ort.InferenceSession(files[kind], providers=["CPUExecutionProvider"])
    feed = {"slip": [0.1, 0.3], "torque": [1.3, 3.1], "load": [40.0, 60.0]}
    if kind == "set":
        context = json.loads(Estimator.load(files[kind]).metadata["set"])["context"]
        feed |= {name: [np.sqrt(ends[0] * ends[1])] for name, ends in context.items()}
    feed = {name: np.asarray(values, np.float32) for name, values in feed.items()}
    branches = (
        [{"joint": np.asarray([joint])} for joint in (True, False)] if kind == "whole" else [{}]
    )
    documented = of_kind(OUTPUTS, kind)
    seen = set()
    for branch in branches:
        sizes = {"rows": 2, "q": 3, "terms + 18": _terms(files[kind]) + 18, "kept_out": 2}
        for name, value in zip(
            documented, session.run(list(documented), feed | branch), strict=True
        ):
            if value.size:
                known = [sizes.get(part, part) for part in documented[name].shape]
                assert list(value.shape) == [int(part) for part in known], name
                seen.add(name)
    rows_may_be_out = {"memory_out"} if kind == "set" else set()
    assert seen | rows_may_be_out == set(documented)


def _terms(file):
    return json.loads(Estimator.load(file).metadata["set"])["terms"]


@pytest.mark.slow
@pytest.mark.parametrize("name", RELEASED)
def test_released_files_have_documented_inputs_and_outputs_only(name):
    session = ort.InferenceSession(
        ROOT / "exported" / f"{name}.onnx", providers=["CPUExecutionProvider"]
    )
    kind = RELEASED[name]
    inputs = session.get_inputs() + session.get_overridable_initializers()
    assert {value.name for value in inputs} <= set(of_kind(INPUTS, kind))
    lacking = set(of_kind(OUTPUTS, kind)) - {value.name for value in session.get_outputs()}
    assert lacking <= {"set_at_edge"}  # files of interface 1
    assert {value.name for value in session.get_outputs()} <= set(of_kind(OUTPUTS, kind))


def test_reasons_and_versions_are_those_of_the_code(small_model):
    reasons = table("Reasons", "code")
    assert [(int(row["code"]), row["name"]) for row in reasons] == [
        (reason.value, reason.name) for reason in Reason
    ]
    versions = {
        row["entry of the metadata"]: row["now"]
        for row in table("Versions", "entry of the metadata")
    }
    assert versions["soilml_format"] == FORMAT and versions["soilml_interface"] == INTERFACE
    metadata = Estimator.load(small_model).metadata
    assert metadata["soilml_format"] == FORMAT and metadata["soilml_interface"] == INTERFACE
    assert f"begins with its version, now {MEMORY_FORMAT}" in " ".join(PAGE.split())


def test_the_minimal_call_is_that_of_the_estimator_and_prints_nothing(whole_file, capfd):
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    names: dict = {}
    exec(block.replace("exported/wheel.onnx", str(whole_file)), names)
    assert capfd.readouterr() == ("", "")
    rows = {name: names["feed"][name] for name in ("slip", "torque", "load")}
    expected = Estimator.load(whole_file).run(**rows)
    assert names["in_range"][0] == expected.in_range
    np.testing.assert_allclose(names["mean"], expected.mean, rtol=1e-4)
    np.testing.assert_allclose(names["std"], expected.std, rtol=1e-4)
