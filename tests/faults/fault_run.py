"""Kill commands at random moments and run them again: `make faults FAULT_KILLS=200`.

After each kill every output is whole, old or new; after the rerun the outputs are those of an
undisturbed run, bit for bit, and nothing else lies beside them. The time from SIGTERM or SIGINT to
the end of the command is printed too.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "examples" / "import")]

from rig import write_logs  # noqa: E402

from soilml.cli.progress import progress_bar  # noqa: E402

LOGS = ("sand_1.csv", "sand_2.csv", "sand_3.csv", "sand_4.csv")
MODEL = """\
[gear]
type = "wheel"
radius = 0.15
width = 0.12
[soil]
name = "wong1989/dry_sand"
[soil.prior]
cohesion = [0.0, 3000.0]
friction_angle = [0.3, 0.8]
shear_modulus = [0.005, 0.04]
[noise]
torque_Nm = "2 %"
drawbar_pull_N = "2 % + 0.2"
"""
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


@dataclass
class Counts:
    """What became of the kills, by command."""

    kills: Counter[str] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)
    #: From SIGTERM or SIGINT to the end, s, of each command that said that it was interrupted.
    seconds: dict[str, list[float]] = field(default_factory=dict)


@contextmanager
def started(folder: Path, words: str) -> Iterator[subprocess.Popen[str]]:
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


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of every file below `folder`, by its path."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in files
    }


def completed(folder: Path, words: str) -> float:
    """Run to the end; the seconds that it took. Raises `RuntimeError` where it fails."""
    begun = time.monotonic()
    with started(folder, words) as process:
        error = process.communicate()[1]
    if process.returncode:
        raise RuntimeError(f"soilml {words}: {error.strip()}")
    return time.monotonic() - begun


def prepared(folder: Path) -> None:
    """The inputs of all commands."""
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


def disturbed(
    folder: Path,
    words: str,
    right: dict[str, str],
    delay: float,
    number: signal.Signals,
    seconds: list[float],
) -> list[str]:
    """Faults after one kill and a rerun, in words; an empty list where there are none.

    `seconds` grows by the time from the signal to the end of a command that was interrupted.
    """
    out = folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    with started(folder, words) as process:
        time.sleep(delay)
        process.send_signal(number)
        begun = time.monotonic()
        process.wait()
        ended = time.monotonic() - begun
        error = process.communicate()[1]
    faults = []
    said = process.returncode == 128 + number and error.count("soilml: interrupted") == 1
    if said:
        seconds.append(ended)
    elif process.returncode not in (0, -number):
        faults.append(f"said {error.strip()[-300:]!r} with status {process.returncode}")
    left = digests(out)
    whole = {name: digest for name, digest in left.items() if not Path(name).name.startswith(".")}
    faults += [f"{name} is not whole" for name in whole if whole[name] != right.get(name)]
    if number != signal.SIGKILL and len(whole) != len(left):
        faults.append(f"left behind: {sorted(left.keys() - whole.keys())}")
    time.sleep(0.2 if number == signal.SIGKILL else 0.0)  # workers end with their parent
    completed(folder, words)
    again = digests(out)
    if again != right:
        changed = sorted(name for name in {*again, *right} if again.get(name) != right.get(name))
        faults.append(f"the rerun differs: {changed}")
    return faults


def run(kills: int, seed: int, counts: Counts, commands: Sequence[str] = tuple(COMMANDS)) -> None:
    """Kill the commands in turn at random moments; count kills and faults by command."""
    rng = random.Random(seed)
    with TemporaryDirectory() as name, progress_bar("kills", kills) as show:
        folder = Path(name)
        prepared(folder)
        right, seconds = {}, {}
        for command in commands:
            shutil.rmtree(folder / "out", ignore_errors=True)
            (folder / "out").mkdir()
            seconds[command] = completed(folder, COMMANDS[command])
            right[command] = digests(folder / "out")
        for i in range(kills):
            command = commands[i % len(commands)]
            delay, number = rng.uniform(0.08, 1.1 * seconds[command]), rng.choice(SIGNALS)
            ended = counts.seconds.setdefault(command, [])
            faults = disturbed(folder, COMMANDS[command], right[command], delay, number, ended)
            counts.kills[command] += 1
            counts.faults[command] += len(faults)
            for fault in faults:
                print(f"{command}, {number.name} after {delay:.2f} s: {fault}", flush=True)
            show(i + 1)


def main() -> int:
    """Print the counts, after Ctrl-C as well; 1 where there was a fault, 130 after Ctrl-C."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("commands", nargs="*", metavar="COMMAND", help=", ".join(COMMANDS))
    args = parser.parse_args()
    counts, interrupted = Counts(), False
    try:
        run(args.kills, args.seed, counts, args.commands or tuple(COMMANDS))
    except KeyboardInterrupt:
        interrupted = True
    for command in args.commands or COMMANDS:
        kills, faults = counts.kills[command], counts.faults[command]
        times = counts.seconds.get(command, [])
        ended = f", {len(times):3} interrupted within {max(times):.2f} s" if times else ""
        print(f"{command:16} {kills:4} kills {faults:4} faults{ended}")
    if interrupted:
        done = counts.kills.total()
        print(f"interrupted after {done} of {args.kills} kills", file=sys.stderr)
        return 130
    return 1 if counts.faults.total() else 0


if __name__ == "__main__":
    sys.exit(main())
