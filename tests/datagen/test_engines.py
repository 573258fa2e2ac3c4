"""Processes: results in order and independent of their number, nothing left behind."""

import functools
import hashlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import RECIPE

from datagen.generate import generate
from datagen.recipe import read_recipe
from datagen.simulation import pieces
from soilml.processes import process_map


def is_alive(process):
    """Whether a process that is not our child runs."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_workers_end_when_the_process_is_killed():
    code = (
        "import os, time\n"
        "from soilml.processes import process_map\n"
        "def f(i):\n    time.sleep(0.2 * (i > 1)); return os.getpid()\n"
        "with process_map(f, range(1000), 2) as found:\n"
        "    print(next(found), next(found), flush=True); list(found)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    workers = process.stdout.readline().split()
    assert workers and all(is_alive(worker) for worker in workers)
    process.kill()
    process.communicate()
    deadline = time.monotonic() + 20
    while any(is_alive(worker) for worker in workers):
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.slow
def test_a_file_has_the_same_bytes_whatever_the_number_of_processes(tmp_path, monkeypatch):
    monkeypatch.setattr("datagen.generate.pieces", functools.partial(pieces, size=256))
    blocks = "[[runs]]\nrows = 1\nshare = 0.5\n[[runs]]\nrows = 8\nshare = 0.5\n"
    (tmp_path / "recipe.toml").write_text(RECIPE.format(rows=1000, seed=1) + blocks)
    recipe = read_recipe(tmp_path / "recipe.toml")
    found = set()
    for workers, method in ((1, None), (3, "fork"), (2, "spawn")):
        done = []
        engine = functools.partial(process_map, workers=workers, start_method=method)
        generate(recipe, tmp_path / "d.parquet", done.append, engine)
        assert done == sorted(done) and done[-1] == 1000 and len(done) == 4
        found.add(hashlib.sha256((tmp_path / "d.parquet").read_bytes()).hexdigest())
    assert len(found) == 1


@pytest.mark.slow
def test_interruption_ends_all_processes_with_one_line(tmp_path):
    first = "[[runs]]\nrows = 1\nshare = 0.002\n[[runs]]\nrows = 2\nshare = 0.998\n"
    (tmp_path / "recipe.toml").write_text(RECIPE.format(rows=4_000_000, seed=1) + first)
    command = [sys.executable, "-m", "soilml", "generate", "recipe.toml", "data.parquet"]
    command += ["--workers", "2"]
    process = subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + 120
    while not any(f.stat().st_size > 9999 for f in tmp_path.glob(".data.parquet.*.part")):
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.05)
    time.sleep(0.2)
    os.killpg(process.pid, signal.SIGINT)  # as from a terminal, which sends it to all
    said = process.communicate()[1]
    lines = [line for line in said.splitlines() if not line.startswith("simulating: ")]  # progress
    assert process.returncode == 130 and len(lines) == 1, said
    with pytest.raises(ProcessLookupError):
        while time.monotonic() < deadline:  # until those that have ended are no more
            os.killpg(process.pid, 0)
            time.sleep(0.05)
    assert "no output was written" in said
    assert [file.name for file in tmp_path.iterdir()] == ["recipe.toml"]
