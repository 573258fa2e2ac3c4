"""Model files and the package on board, with every release of onnxruntime that it allows."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from filelock import FileLock
from packaging.requirements import Requirement
from packaging.version import Version

from soilml import Estimator

pytestmark = [pytest.mark.long, pytest.mark.network]

ROOT = Path(__file__).parents[1]
WHEEL = {
    "wheel_radius": 0.15,
    "wheel_width": 0.12,
    "bearing_modulus": 1.54e6,
    "n": 1.1,
    "bearing_std": 0.1,
    "cohesion_max": 3000.0,
    "shear_modulus_max": 0.03,
}
#: Python, onnxruntime and numpy: the oldest that are allowed, releases that fused nodes with names
#: of their own making, the newest of Python 3.10, by the file with
#: hashes, and the newest that is allowed.
MATRIX = [
    ("3.10", "1.19.0", "2.1.0"),
    ("3.11", "1.19.0", "2.1.0"),
    ("3.11", "1.20.1", None),
    ("3.11", "1.21.1", None),
    ("3.11", "1.22.1", None),
    (FROM_LOCK := ("3.10", "1.23.2", "2.2.6")),
    ("3.11", "1.32.0", None),
]
PARAMETERS = [pytest.param(entry, id=f"python{entry[0]}-ort{entry[1]}") for entry in MATRIX]
#: Runs on the other Python: estimates of the files that it is given, as JSON.
PROGRAM = """
import json, sys
from soilml.onboard import Estimator
files, readings, wheel = json.loads(sys.argv[1])
answers = []
for file in files:
    estimator = Estimator.load(file)
    if estimator.sets is not None and estimator.sets.missing_context:
        estimator = estimator.on(**wheel)
    memory = estimator.start()
    for row in zip(*readings.values()):
        now, memory = estimator.step(memory, **dict(zip(readings, row)))
    for found in (estimator(**readings), estimator.run(**readings), now):
        answers.append([found.mean.tolist(), found.std.tolist(), found.in_range.tolist()])
print(json.dumps(answers))
"""


def readings():
    """Rows of the reference wheel on one soil."""
    from soilml import Model, Operating, Wheel, soil

    slip = np.asarray([0.1, 0.2, 0.3, 0.4, 0.5, 0.25])
    load = np.asarray([40.0, 90.0, 60.0, 75.0, 50.0, 100.0])
    sand = soil("wong1989/dry_sand", cohesion=1300.0, friction_angle=0.6, shear_modulus=0.015)
    force = Model(Wheel(radius=0.15, width=0.12))(sand, Operating(slip=slip, load=load))
    return {"slip": slip.tolist(), "torque": force.torque.tolist(), "load": load.tolist()}


def require_registry():
    """Skip the test where no package registry is reached."""
    command = [sys.executable, "-m", "pip", "index", "versions", "onnxruntime"]
    found = subprocess.run(command, capture_output=True, check=False)
    if found.returncode != 0:
        pytest.skip("no package registry is reached")


def find_python(version):
    """An interpreter of a version, on the path or among those of pyenv."""
    installed = sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python"))
    for found in (shutil.which(f"python{version}"), *map(str, installed)):
        if found and subprocess.run([found, "-V"], capture_output=True).returncode == 0:
            return found
    return pytest.skip(f"no Python {version} on this machine")


@pytest.fixture(scope="module", params=PARAMETERS)
def board(request):
    """The interpreter of an environment with these versions, kept for later runs of the tests."""
    version, runtime, numpy = request.param
    interpreter = find_python(version)
    name = f"board-{version}-{runtime}-{numpy}"
    folder = request.config.cache.mkdir(name) / "environment"
    own, complete = folder / "bin" / "python", folder / "complete"
    with FileLock(folder.with_suffix(".lock")):
        if complete.exists():
            return own
        require_registry()
        subprocess.run([interpreter, "-m", "venv", "--clear", folder], check=True)
        wanted = [f"onnxruntime=={runtime}", *([f"numpy=={numpy}"] if numpy else [])]
        wanted += ["tomli"] if version == "3.10" else []
        if request.param == FROM_LOCK:
            wanted = ["--require-hashes", "-r", ROOT / "tools" / "supply" / "onboard-hashes.txt"]
        command = [own, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *wanted]
        subprocess.run([str(part) for part in command], check=True)
        complete.touch()
    return own


def on(board, *arguments, cwd):
    """What a command of that interpreter prints; the package is that of the tree."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [str(board), *arguments], cwd=cwd, capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_all_releases_give_the_same_estimates(board, whole_file, any_set_file, tmp_path):
    files = [str(whole_file), str(any_set_file)]
    task = json.dumps([files, rows := readings(), WHEEL])
    answers = iter(json.loads(on(board, "-c", PROGRAM, task, cwd=tmp_path)))
    for file in files:
        own = Estimator.load(file)
        own = own if file == files[0] else own.on(**WHEEL)
        memory = own.start()
        for i in range(6):
            now, memory = own.step(memory, **{name: values[i] for name, values in rows.items()})
        for expected in (own(**rows), own.run(**rows), now):
            mean, std, in_range = next(answers)
            assert in_range == expected.in_range.tolist()
            assert np.all(in_range)
            assert (np.abs(mean - expected.mean) < 0.02 * expected.std).all()
            np.testing.assert_allclose(std, expected.std, rtol=0.02)


def test_the_command_line_estimates_on_the_oldest_python(board, whole_file, tmp_path):
    rows = readings()
    lines = [f"a,{s},{w},{t}" for s, t, w in zip(*rows.values(), strict=True)]
    (tmp_path / "runs.csv").write_text("\n".join(["run,slip,load_N,torque_Nm", *lines]) + "\n")
    code = "import sys; from soilml.cli import main; sys.exit(main(sys.argv[1:]))"
    command = ["estimate", str(whole_file), "runs.csv", "--by", "run"]
    table = on(board, "-c", code, *command, cwd=tmp_path).splitlines()
    found = dict(zip(table[0].split(","), table[1].split(","), strict=True))
    expected = Estimator.load(whole_file).run(**rows)
    assert float(found["friction_angle_rad"]) == pytest.approx(expected["friction_angle"][0], 1e-3)


def test_the_matrix_begins_and_ends_where_the_package_does():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    needed = {r.name: r.specifier for r in map(Requirement, project["dependencies"])}
    for version, runtime, numpy in MATRIX:
        assert Version(runtime) in needed["onnxruntime"]
        assert numpy is None or Version(numpy) in needed["numpy"]
        assert f"Programming Language :: Python :: {version}" in project["classifiers"]
    runtimes = [Version(runtime) for _, runtime, _ in MATRIX]
    for end, step in ((min(runtimes), -1), (max(runtimes), 1)):
        assert Version(f"{end.major}.{end.minor + step}.0") not in needed["onnxruntime"]
