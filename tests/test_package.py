"""A wheel built from the tree works in a clean environment with the board's libraries alone."""

import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
RUNS = "run,slip,load_N,torque_Nm\na,0.2,60,3.0\na,0.4,60,4.2\n"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"]
    command += ["--no-build-isolation", "--wheel-dir", str(folder), str(ROOT)]
    subprocess.run(command, check=True)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def board(wheel, tmp_path_factory):
    """The programs of an environment that holds the wheel and what it asks for."""
    folder = tmp_path_factory.mktemp("board")
    venv.create(folder, with_pip=True)
    command = [folder / "bin" / "python", "-m", "pip", "install", "--quiet", "--no-compile"]
    command += ["--constraint", ROOT / "constraints.txt", wheel]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    subprocess.run([str(part) for part in command], check=True, env=environment)
    return folder / "bin"


def run(program, *arguments, cwd):
    return subprocess.run(
        [str(program), *arguments], cwd=cwd, capture_output=True, text=True, check=False
    )


@pytest.mark.long
def test_two_builds_are_the_same_to_the_last_byte(tmp_path):
    built = []
    for name in ("first", "second"):
        command = [sys.executable, "-m", "hatchling", "build", "-d", str(tmp_path / name)]
        subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
        built.append({file.name: file.read_bytes() for file in (tmp_path / name).iterdir()})
    assert built[0] == built[1] and len(built[0]) == 2


def test_the_wheel_holds_the_packages_and_their_data(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    for needed in (
        "soilml/physics/soils/wong1989.toml",
        "datagen/recipes/wheel.toml",
        "training/specs/fused.toml",
        "soilml/py.typed",
        "soilml/__init__.pyi",
        *(f"soilml/examples/{name}" for name in ("campaign/runs.csv", "log/rig.csv")),
        *(f"soilml/released/{file.name}" for file in (ROOT / "exported").glob("*.onnx")),
    ):
        assert needed in names
    assert not [n for n in names if n.startswith(("tests/", "bench/", "tools/", "exported/"))]


@pytest.mark.network
def test_a_bare_install_brings_numpy_and_onnxruntime_alone(board, tmp_path):
    done = run(board / "python", "-m", "pip", "list", "--format=freeze", cwd=tmp_path)
    installed = {line.split("==")[0].lower() for line in done.stdout.splitlines()}
    assert {"soilml", "numpy", "onnxruntime"} <= installed
    for ground in ("scipy", "torch", "scikit-learn", "pyarrow", "matplotlib", "onnx"):
        assert ground not in installed


@pytest.mark.network
def test_the_board_estimates_as_the_ground_does(board, tmp_path, small_model):
    from soilml import Estimator

    (tmp_path / "runs.csv").write_text(RUNS)
    words = ("estimate", str(small_model), "runs.csv", "--format", "csv")
    done = run(board / "soilml", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = [line.split(",") for line in done.stdout.splitlines()]
    column = rows[0].index("cohesion_Pa")
    expected = Estimator.load(small_model)(slip=[0.2, 0.4], torque=[3.0, 4.2], load=60.0)
    found = [float(row[column]) for row in rows[1:]]
    np.testing.assert_allclose(found, expected.mean[:, 0], rtol=1e-5)


@pytest.mark.network
def test_the_board_simulates_and_says_what_it_lacks(board, tmp_path):
    from conftest import MODEL

    (tmp_path / "m.toml").write_text(MODEL)
    (tmp_path / "runs.csv").write_text(RUNS)
    words = ("simulate", "m.toml", "--slip", "0.3", "--load", "60", "--format", "csv")
    done = run(board / "soilml", *words, cwd=tmp_path)
    assert done.returncode == 0 and done.stdout.count("\n") == 2
    for command in (
        ["identify", "m.toml", "runs.csv"],
        ["generate", "wheel", "d.parquet"],
        ["train", "fused", "d.parquet", "m.onnx"],
    ):
        done = run(board / "soilml", *command, cwd=tmp_path)
        assert done.returncode == 2
        assert "pip install '.[ground]'" in done.stderr
        assert done.stderr.count("\n") == 1
