"""What a command loads before it has anything to do: help and errors of usage answer at once."""

import os
import subprocess
import sys

import pytest

from soilml.cli.main import COMMANDS

#: Runs the command line with the arguments of the process, then lists the modules on the last line.
LISTING = """\
import sys
before = set(sys.modules)
from soilml.cli.main import main
print("status", main())
print(*sorted(set(sys.modules) - before))
"""
OWN = ("soilml", "datagen", "training")


def modules_after(*words, cwd=None):
    """Modules that are not of the standard library, and what was printed before them."""
    done = subprocess.run(
        [sys.executable, "-c", LISTING, *map(str, words)], capture_output=True, text=True, cwd=cwd
    )
    assert done.returncode == 0, done.stderr
    *printed, names = done.stdout.splitlines()
    return {m for m in names.split() if m.split(".")[0] not in sys.stdlib_module_names}, printed


def commands_among(modules):
    return {name for name in COMMANDS if COMMANDS[name] in modules}


def test_an_error_of_usage_loads_no_library_and_no_other_command():
    """All commands in one process, one after the other."""
    code = LISTING.replace(
        'print("status", main())',
        "for name in sys.argv[1:]:\n"
        "    print('status', main([*name.split(), '--nonsense']), *sys.modules)",
    )
    done = subprocess.run([sys.executable, "-c", code, *COMMANDS], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    *printed, loaded = done.stdout.splitlines()
    libraries = {name.split(".")[0] for name in loaded.split()} - set(sys.stdlib_module_names)
    assert libraries <= set(OWN)
    lines = [line.split() for line in printed if line.startswith("status ")]
    assert [words[1] for words in lines] == ["2"] * len(COMMANDS)
    for i, words in enumerate(lines):
        assert commands_among(words) == set(list(COMMANDS)[: i + 1])


@pytest.mark.parametrize(
    ("words", "commands"),
    [("--help", set()), ("pull --help", {"pull"}), ("--version", set()), ("nonsense", set())],
)
def test_help_version_and_unknown_commands_load_no_library(words, commands):
    loaded, _ = modules_after(*words.split())
    assert {name.split(".")[0] for name in loaded} <= set(OWN)
    assert commands_among(loaded) == commands


@pytest.mark.slow
def test_identify_loads_neither_distributions_nor_the_runtime_for_trained_models(
    model_file, tmp_path
):
    lines = ["run,slip,load_N,torque_Nm"]
    lines += [f"a,{slip},{load},{slip * load / 10}" for slip in (0.2, 0.4) for load in (40, 90)]
    (tmp_path / "runs.csv").write_text("\n".join(lines) + "\n")
    loaded, printed = modules_after("identify", model_file, tmp_path / "runs.csv")
    assert "scipy" in loaded and "cohesion" in "".join(printed)
    unused = {"scipy.stats", "onnxruntime", "torch", "sklearn", "pyarrow", "matplotlib"}
    assert not loaded & unused


@pytest.mark.parametrize("chosen", [None, "0"])
def test_loading_a_model_leaves_no_trace_of_telemetry(small_model, tmp_path, chosen):
    """onnxruntime would write an identifier below the home folder, and look up a vendor's host."""
    environment = {k: v for k, v in os.environ.items() if k != "ORT_DISABLE_TELEMETRY"}
    environment |= {"HOME": str(tmp_path)} | ({"ORT_DISABLE_TELEMETRY": chosen} if chosen else {})
    environment.pop("XDG_CACHE_HOME", None)
    code = (
        "import os, sys; from soilml import Estimator; Estimator.load(sys.argv[1]);"
        "print(os.environ['ORT_DISABLE_TELEMETRY'])"
    )
    command = [sys.executable, "-c", code, str(small_model)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    assert done.stdout.strip() == (chosen or "1")
    if chosen is None:
        assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_estimate_runs_by_the_libraries_of_the_board_alone(small_model, model_file, tmp_path):
    (tmp_path / "runs.csv").write_text("run,slip,load_N,torque_Nm\na,0.2,60,3.0\na,0.4,60,4.2\n")
    words = "estimate", small_model, tmp_path / "runs.csv", "--by", "run", "--model", model_file
    loaded, printed = modules_after(*words)
    assert any("cohesion" in line for line in printed)
    libraries = {name.split(".")[0] for name in loaded}
    ground = {"scipy", "sklearn", "torch", "onnx", "jinja2", "matplotlib", "pandas", "pyarrow"}
    assert {"numpy", "onnxruntime"} <= libraries and not libraries & ground
