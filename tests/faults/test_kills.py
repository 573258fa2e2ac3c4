"""Commands that are killed at random moments: outputs are whole, and a rerun makes them anew.

After a kill every output that is there is whole; after the rerun the outputs are those of an
undisturbed run, bit for bit, and nothing else lies beside them. `make faults FAULT_KILLS=30` kills
each command so often.
"""

import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from conftest import THREE_CHANNEL_MODEL as MODEL

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "examples" / "import"))

from rig import write_logs  # noqa: E402

KILLS = int(os.environ.get("FAULT_KILLS", "0"))
LOGS = ("sand_1.csv", "sand_2.csv", "sand_3.csv", "sand_4.csv")
#: What is killed: the words of each command, in a folder with its inputs; it writes below `out`.
COMMANDS = {
    "generate": "generate wheel out/d.parquet --rows 60000 --workers 2",
    "train": "train spec.toml data.parquet out/m.onnx",
    "gap": "gap model.toml runs.csv --out out",
    "estimate": "estimate wheel.onnx long.csv --out out/e.csv",
    "import": f"import {' '.join(LOGS)} --map map.toml --out out/runs.csv",
    "simulate": "simulate model.toml --slip 0:0.6:400 --load 30:90:400 --out out/s.csv",
}
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)


@contextmanager
def started(folder, words):
    """The command in a process group of its own, which is killed where the caller is."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, "-m", "soilml", *words.split()],
        cwd=folder,
        env=environment,
        text=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()


def digests(folder):
    """SHA-256 of every file below `folder`, by its path."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in files
    }


def completed(folder, words):
    """Run to the end; the seconds that it took."""
    begun = time.monotonic()
    with started(folder, words) as process:
        error = process.communicate()[1]
    assert process.returncode == 0, error
    return time.monotonic() - begun


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The inputs of all commands."""
    folder = tmp_path_factory.mktemp("killed")
    write_logs(folder)
    (folder / "model.toml").write_text(MODEL)
    (folder / "spec.toml").write_text('[[regressor]]\ntype = "linear"\n')
    shutil.copy(ROOT / "exported" / "wheel.onnx", folder / "wheel.onnx")
    completed(folder, f"import --init {' '.join(LOGS)} --out map.toml")
    chart = folder / "map.toml"
    chart.write_text(chart.read_text().replace("gear_ratio = 1 ", "gear_ratio = 99 "))
    completed(folder, "generate wheel data.parquet --rows 2000 --workers 1")
    completed(folder, "simulate model.toml --slip 0.05:0.6:6 --load 30:90:5 --run a --out one.csv")
    completed(folder, "simulate model.toml --slip 0.05:0.6:6 --load 40:80:5 --run b --out two.csv")
    completed(folder, "simulate model.toml --slip 0.05:0.6:60 --load 30:90:80 --out grid.csv")
    one, two = ((folder / name).read_text().splitlines() for name in ("one.csv", "two.csv"))
    (folder / "runs.csv").write_text("\n".join([*one, *two[1:]]) + "\n")
    grid = (folder / "grid.csv").read_text().splitlines()
    long = [f"run,{grid[0]}", *(f"r{i % 7},{line}" for i, line in enumerate(grid[1:]))]
    (folder / "long.csv").write_text("\n".join(long) + "\n")
    return folder


def killed(folder, words, delay, number):
    """Kill a command after a delay; what it said with a status of its own, else nothing."""
    with started(folder, words) as process:
        time.sleep(delay)
        process.send_signal(number)
        error = process.communicate()[1]
    said = process.returncode == 128 + number and error.count("soilml: interrupted") == 1
    return "" if said or process.returncode in (0, -number) else f"{process.returncode}: {error}"


@pytest.mark.long
@pytest.mark.parametrize("command", COMMANDS if KILLS else ["simulate", "generate"])
def test_a_rerun_after_a_kill_is_as_if_nothing_had_happened(folder, command, subtests):
    out, words, rng = folder / "out", COMMANDS[command], random.Random(KILLS)
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    seconds = completed(folder, words)
    right = digests(out)
    for _ in range(KILLS or 1):
        delay, number = rng.uniform(0.08, 1.1 * seconds), rng.choice(SIGNALS)
        shutil.rmtree(out)
        out.mkdir()
        with subtests.test(f"{number.name} after {delay:.2f} s"):
            assert not killed(folder, words, delay, number)
            left = digests(out)
            whole = {name: own for name, own in left.items() if not Path(name).name.startswith(".")}
            assert whole.items() <= right.items()
            assert number == signal.SIGKILL or whole == left
            time.sleep(0.2 if number == signal.SIGKILL else 0.0)  # workers end with their parent
            completed(folder, words)
            assert digests(out) == right
