"""Where commands write: not over what they read, all files or none, nothing left when stopped."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import MODEL, RECIPE
from console import refused

from soilml.cli import main

RUNS = "run,slip,load_N,torque_Nm\nä,0.1,60,1.5\nä,0.3,80,3.0\nä,0.5,90,5.0\n"
SIMULATE = ["simulate", "model.toml", "--slip", "0.1", "--load", "60"]


@pytest.fixture
def folder(workplace):
    (workplace / "model.toml").write_text(MODEL)
    (workplace / "recipe.toml").write_text(RECIPE.format(rows=300, seed=1))
    (workplace / "spec.toml").write_text('[[regressor]]\ntype = "linear"\n')
    (workplace / "runs.csv").write_text(RUNS)
    return workplace


def test_no_command_writes_over_what_it_reads(folder, capsys, small_model, small_data):
    (folder / "m.csv").write_text(MODEL)
    (folder / "r.json").write_text(RUNS)
    (folder / "link.csv").symlink_to("runs.csv")
    (folder / "o.md").write_bytes(small_data.read_bytes())
    (folder / "compare.csv").write_bytes(small_data.read_bytes())
    model, data = str(small_model), str(small_data)
    for command in (
        ["estimate", model, "runs.csv", "--out", "runs.csv"],
        ["estimate", model, "runs.csv", "--out", "./link.csv"],
        ["identify", "model.toml", "r.json", "--out", "r.json"],
        ["simulate", "m.csv", "--slip", "0.1", "--load", "60", "--out", "m.csv"],
        ["train", "spec.toml", "o.md", "o.onnx"],
        ["compare", "model.toml", "compare.csv", model, "--out", "."],
    ):
        refused(command, capsys, "is an input and would be overwritten", folder)
    for command, said in (
        (["identify", "model.toml", "runs.csv", "--out", "model.toml"], "must end in .json"),
        (["generate", "recipe.toml", "recipe.toml"], "must end in .parquet"),
        (["compare", "model.toml", data, model, "--out", "m.csv"], "m.csv is a file; needed is a"),
    ):
        refused(command, capsys, said, folder)


def test_a_target_in_the_way_is_found_before_any_work_and_nothing_is_replaced(
    folder, capsys, small_data
):
    (folder / "o.md").mkdir()
    (folder / "o.onnx").write_text("good")
    refused(["train", "spec.toml", str(small_data), "o.onnx"], capsys, "o.md is a folder")
    assert (folder / "o.onnx").read_text() == "good"
    os.mkfifo(folder / "o.csv")
    refused([*SIMULATE, "--out", "o.csv"], capsys, "o.csv is a device, pipe")


def run_soilml(folder, *words, **options):
    options.setdefault("stderr", subprocess.PIPE)
    command = [sys.executable, "-c", "import sys; from soilml.cli import main; sys.exit(main())"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)} | options.pop("env", {})
    return subprocess.Popen([*command, *words], cwd=folder, env=environment, text=True, **options)


def one_line(process, status, said):
    error = process.communicate(timeout=120)[1]
    assert process.returncode == status, error
    assert error.count("\n") == 1 and said in error, error


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "status"), [("SIGTERM", 143), pytest.param("SIGHUP", 129, marks=pytest.mark.long)]
)
def test_a_signal_to_stop_leaves_nothing_half_written(folder, name, status):
    number = getattr(signal, name)
    process = run_soilml(
        folder,
        *("generate", "recipe.toml", "o.parquet", "--rows", "9000000"),
        preexec_fn=lambda: signal.signal(number, signal.SIG_DFL),  # tests may run under nohup
    )
    for _ in range(600):
        if any(p.suffix == ".part" for p in folder.iterdir()):
            break
        time.sleep(0.1)
    process.send_signal(number)
    one_line(process, status, "interrupted")
    assert not any("o.parquet" in p.name for p in folder.iterdir())


@pytest.mark.slow
def test_a_closed_standard_output_is_one_line(folder):
    def close():
        os.close(1)

    one_line(run_soilml(folder, *SIMULATE, preexec_fn=close), 2, "standard output is closed")
    process = run_soilml(folder, *SIMULATE, "--out", "o.csv", preexec_fn=close)
    one_line(process, 0, "1 row written")
    assert (folder / "o.csv").read_text().startswith("slip,")


@pytest.mark.slow
def test_files_that_read_the_same_are_not_fused_as_if_they_erred_independently(tmp_path, capsys):
    (tmp_path / "log.csv").write_text("run,slip,load_N,torque_Nm\na,0.2,60,2.1\n")
    words = ["estimate", "wheel", tmp_path / "log.csv", "--with", "wheel"]
    refused(words, capsys, "do not state their errors on common rows")


def test_every_argument_that_names_an_input_file_is_declared_as_one():
    from soilml.cli.main import parser
    from soilml.cli.options import InputFile, leaves

    outputs = {"out", "picture", "c", "over_time"}
    for name, command in leaves(parser()):
        for action in command._actions:
            is_file = "." in str(action.metavar) or action.dest == "files"
            if "..." in str(action.metavar):
                continue
            expected = is_file and action.dest not in outputs
            assert (action.type is InputFile) == expected, f"{name} {action.dest}"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
@pytest.mark.parametrize("command", ["--version", "identify --help", "identify no.toml no.csv"])
@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_full_streams_end_with_status_2_where_something_had_to_be_said(folder, command, stream):
    with Path("/dev/full").open("w") as full:
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | {stream: full}
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        words = [sys.executable, "-m", "soilml", *command.split()]
        done = subprocess.run(words, text=True, env=environment, **streams)
    assert done.returncode == (2 if stream == "stdout" or "no.toml" in command else 0)
    other = done.stderr if stream == "stdout" else done.stdout
    assert "Traceback" not in other and "Exception" not in other


def test_a_name_that_is_not_utf_8_is_to_be_renamed(folder, capsys):
    """No setting of the output helps it."""
    runs = os.fsdecode(b"bad\xff.csv")
    try:
        Path(runs).write_text(RUNS)
    except OSError:
        pytest.skip("the file system takes no such name")
    assert main(["gap", "model.toml", runs, "--out", "found"]) == 2
    said = capsys.readouterr().err
    assert "rename it" in said and "PYTHONIOENCODING" not in said
