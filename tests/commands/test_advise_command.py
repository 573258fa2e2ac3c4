"""`soilml advise`, and what `identify` and `estimate` say of the next row."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import MODEL
from console import printed, rows_of

from soilml.cli import main

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
RUNS = "run,slip,load_N,torque_Nm\na,0.2,60,2.9\na,0.2,60,2.95\n"


@pytest.fixture
def folder(workplace):
    (workplace / "model.toml").write_text(MODEL)
    (workplace / "runs.csv").write_text(RUNS)
    return workplace


def test_the_table_names_the_best_rows_and_what_they_leave(folder, capsys):
    command = [
        "plan",
        "next",
        "model.toml",
        "runs.csv",
        "--slip",
        "0.05,0.6",
        "--load",
        "30,60,120",
    ]
    assert main([*command, "--count", "2", "--out", "o.csv", "--picture", "o.png"]) == 0
    assert capsys.readouterr().out.startswith("Measure next: slip 0.6 at 120 N")
    assert (folder / "o.png").read_bytes().startswith(b"\x89PNG")
    rows = rows_of((folder / "o.csv").read_text())
    assert list(rows[0]) == [
        "row", "channels", "slip", "load_N", "cohesion_left", "friction_angle_left",
        "shear_modulus_left", "all_left",
    ]  # fmt: skip
    assert [r["row"] for r in rows] == [
        "best in all", "best for cohesion", "best for friction angle", "best for shear modulus",
        "best repeat", "row 1 of 2", "row 2 of 2",
    ]  # fmt: skip
    by = {r["row"]: r for r in rows}
    assert (by["best repeat"]["slip"], by["best repeat"]["load_N"]) == ("0.2", "60")
    best, repeat = (float(by[row]["cohesion_left"]) for row in ("best for cohesion", "best repeat"))
    assert best < repeat
    assert float(by["row 2 of 2"]["all_left"]) < float(by["row 1 of 2"]["all_left"])


def test_the_posterior_says_what_is_identified_and_what_to_drive_next(folder, capsys):
    command = ["identify", "model.toml", "runs.csv", "--method", "posterior"]
    content = json.loads(printed([*command, "--format", "json"], capsys).out)
    assert [name for name, told in content["identified"].items() if told] == ["shear_modulus"]
    left = content["advice"]["next_for"]["cohesion"]["remaining_fraction"]["cohesion"]
    assert left < content["advice"]["repeat"]["remaining_fraction"]["cohesion"] - 0.2
    # least squares: no samples, no advice
    assert main([*command[:3], "--method", "nonlinear", "--out", "o.json"]) == 0
    assert "identified" not in json.loads((folder / "o.json").read_text())
    by_run = json.loads(printed([*command, "--by", "run", "--format", "json"], capsys).out)
    assert "advice" in by_run["runs"]["a"]


def test_the_board_abstains_with_numpy_and_onnxruntime_alone(folder, small_model):
    code = (
        "import sys\n"
        "class No:\n"
        "    def find_spec(self, name, *rest):\n"
        "        if name.split('.')[0] in ('scipy', 'torch', 'pyarrow', 'array_api_compat',"
        " 'matplotlib', 'sklearn', 'onnx', 'jinja2'):\n"
        "            raise ImportError('no ' + name)\n"
        "sys.meta_path.insert(0, No())\n"
        "import argparse\n"
        "from soilml.cli import options\n"
        "from soilml.cli.commands import estimate\n"
        "parser = argparse.ArgumentParser()\n"
        "options.declare(parser, estimate.ARGUMENTS)\n"
        "estimate.run(parser.parse_args())\n"
    )
    command = [sys.executable, "-c", code, str(small_model), "runs.csv", "--by", "run"]
    command += ["--model", "model.toml"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=environment)
    assert done.returncode == 0, done.stderr
    assert "mostly the prior" in done.stdout
