"""Ctrl-C at any moment from the first import on: one line, status 130, no file."""

import os
import signal
import subprocess
import sys

import pytest
from conftest import MODEL

from soilml.cli import main
from soilml.io.atomic_files import Swap

#: Runs the command line; SIGINT arrives when the named module is imported.
INTERRUPTED = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
module, *words = sys.argv[1:]
class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == module:
            os.kill(os.getpid(), signal.SIGINT)
        return None
sys.meta_path.insert(0, Interrupt())
from soilml.cli import main
sys.exit(main(words))
"""
RUNS = "run,slip,load_N,torque_Nm\na,0.1,60,1.5\na,0.3,80,3.0\na,0.5,90,5.0\n"


@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("soilml.cli.main", "simulate model.toml --slip 0.1 --load 60"),
        ("numpy", "simulate model.toml --slip 0.1 --load 60 --out out.csv"),
        ("scipy.special", "identify model.toml runs.csv --out out.json"),
        ("jinja2", "gap model.toml runs.csv --out found"),
        ("pyarrow", "generate wheel out.parquet --rows 10"),
        ("onnxruntime", "estimate {model} runs.csv"),
    ],
)
def test_ctrl_c_in_an_import(tmp_path, small_model, module, words):
    (tmp_path / "model.toml").write_text(MODEL)
    (tmp_path / "runs.csv").write_text(RUNS)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, module, *words.format(model=small_model).split()],
        cwd=tmp_path, env=environment, capture_output=True, text=True,
    )  # fmt: skip
    *progress, said = done.stderr.splitlines()  # a slow machine shows progress before
    assert said == "soilml: interrupted; no output was written"
    assert all(line.endswith(" ...") for line in progress)
    assert done.returncode == 128 + signal.SIGINT
    assert sorted(path.name for path in tmp_path.iterdir()) == ["model.toml", "runs.csv"]


@pytest.mark.parametrize("where", ["__enter__", "__exit__"])
def test_a_signal_as_a_set_of_files_begins_or_ends_leaves_nothing(
    tmp_path, monkeypatch, capsys, where
):
    """Python calls neither method to the end where a signal arrives in it."""
    (tmp_path / "model.toml").write_text(MODEL)
    done = getattr(Swap, where)

    def interrupted(swap, *error):
        if where == "__enter__":
            done(swap)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Swap, where, interrupted)
    monkeypatch.chdir(tmp_path)
    assert (
        main(["simulate", "model.toml", "--slip", "0.1", "--load", "60", "--out", "s.csv"]) == 130
    )
    said = capsys.readouterr().err
    assert said.startswith("soilml: interrupted; ") and said.count("\n") == 1
    complete = where == "__exit__"
    assert ("complete before that: s.csv" in said) == complete
    files = ["model.toml", "s.csv"] if complete else ["model.toml"]
    assert sorted(path.name for path in tmp_path.iterdir()) == files
