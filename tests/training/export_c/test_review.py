"""What docs/decisions/generated-c.md states: stack, recursion, loops, state, tests."""

import os
import re
import subprocess
import sys

import pytest
from c_call_graph import call_graph
from compiled_c import COMPILERS, ROOT

PAGE = ROOT / "docs/decisions/generated-c.md"
#: Functions of the C library that the code may call: mathematics, and copies of memory.
LIBRARY = {
    *("cos", "exp", "floor", "log", "sin", "sqrt", "tanh", "rint", "fabs"),
    *("cosf", "expf", "floorf", "logf", "sinf", "sqrtf", "tanhf", "rintf", "fabsf"),
    *("sincos", "sincosf", "memcpy", "memset", "memmove"),
}
#: Largest stack by file that the page states, bytes, where float is 4 and double 8.
STACK = {"wheel_linear": 1000, "slip_torque": 1000, "wheel_lssvm": 1000, "wheel": 4500}
LINES = 450  # Largest number of lines of a function that the page states
SMALL = [name for name in STACK if name != "wheel"]
gcc = pytest.mark.skipif("gcc" not in COMPILERS, reason="no gcc")


@gcc
@pytest.mark.parametrize("name", [*SMALL, pytest.param("wheel", marks=pytest.mark.slow)])
def test_stack_is_bounded_nothing_recurses_and_mathematics_alone_is_called(
    name, exported, tmp_path
):
    graph = call_graph(exported(name) / f"{name}.c", tmp_path / "made.o")
    assert {function for function, size in graph.stack.items() if size is None} <= LIBRARY
    assert graph.deepest_of_all()[0] < STACK[name]
    listed = subprocess.run(["nm", tmp_path / "made.o"], capture_output=True, text=True)
    kinds = {line.split()[-2] for line in listed.stdout.splitlines()}
    assert kinds <= {"T", "t", "r", "U"}  # functions and constants: no state


@pytest.mark.parametrize("name", [*SMALL, pytest.param("wheel", marks=pytest.mark.slow)])
def test_every_loop_counts_to_a_number_that_is_known_before_it_begins(name, exported):
    source = (exported(name) / f"{name}.c").read_text()
    code = re.sub(r"/\*.*?\*/", "", source, flags=re.DOTALL)
    assert not re.search(r"\b(while|goto|do|malloc|free|alloca|longjmp)\b", code)
    heads = re.findall(r"\bfor \((.*?)\)(?=\s*[\n{])", code)
    assert heads and all(head.count(";") == 2 and head.split(";")[1].strip() for head in heads)


@pytest.mark.parametrize("name", [*SMALL, pytest.param("wheel", marks=pytest.mark.slow)])
def test_no_function_is_longer_than_the_page_says(name, exported):
    source = (exported(name) / f"{name}.c").read_text()
    bodies = re.findall(r"^[a-z][^;={}]*\)\n\{\n(.*?)^\}", source, re.MULTILINE | re.DOTALL)
    assert len(bodies) > 5
    assert max(body.count("\n") for body in bodies) <= LINES


@pytest.mark.slow
def test_the_export_of_a_set_posterior_is_deterministic(exported, tmp_path):
    """Bit by bit, in another process with another order of hashes."""
    name = "wheel_small"
    model, out = ROOT / "exported" / f"{name}.onnx", tmp_path / f"{name}.c"
    program = "import sys; from soilml.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", program, "export", "c", str(model), str(out)]
    done = subprocess.run(command, env=os.environ | {"PYTHONHASHSEED": "7"}, cwd=ROOT)
    assert done.returncode == 0
    for made in (out, out.with_suffix(".h")):
        assert made.read_bytes() == (exported(name) / made.name).read_bytes()


def test_every_requirement_of_the_page_names_tests_that_exist():
    rows = [line for line in PAGE.read_text().splitlines() if re.match(r"\| C\d", line)]
    assert len(rows) >= 12
    for row in rows:
        named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", row)
        assert named, row
        for file, test in named:
            text = (ROOT / "tests" / "training" / "export_c" / file).read_text()
            assert f"def {test}(" in text, f"{file}::{test}"
