"""This version beside version 0.1.0, in processes that take turns on one machine."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: The last commit of version 0.1.0 before its code was rearranged.
FORMER = "bd3931a7aacab0904f4ecbfc5b14a143026ce5a3"
FOLDERS = ("soilml", "datagen", "exported", "training")
#: Solutions of a driving wheel per second by version 0.1.0, on the machine that the goals are for.
GOALS_MACHINE = 188_000.0
ROUNDS = 2


@dataclass(frozen=True)
class Task:
    """A task of `former_tasks`: its name in the table, its unit, and the goal as a ratio."""

    name: str
    unit: str
    scale: float
    goal: str = ""


TASKS = {
    "driving": Task("equilibrium of a driving wheel", "us", 1e6, "4"),
    "in calls of 1000": Task("the same in calls of 1000 rows", "us", 1e6, "4"),
    "two effects": Task("driving, with slip-sinkage and bulldozing", "us", 1e6),
    "braking": Task("equilibrium of a braking wheel", "us", 1e6, "3.3"),
    "nonlinear": Task("`identify` 64 rows, nonlinear least squares", "ms", 1e3),
    "posterior": Task("`identify` 64 rows, posterior", "s", 1.0),
    "no gap": Task("`gap` 64 rows of 2 channels, nothing hidden", "s", 1.0),
    "gap": Task("`gap` 64 rows of 2 channels, slip-sinkage hidden", "s", 1.0),
    "one reading": Task("one reading through `Estimator`, `wheel.onnx`", "us", 1e6),
    "set": Task("set of 16 through `Estimator.run`, `wheel.onnx`", "us", 1e6, "1.9"),
}


def table() -> str:
    """The times of both versions, their ratios, and how fast this machine is; or why not."""
    archive = subprocess.run(
        ["git", "archive", FORMER, *FOLDERS], cwd=ROOT, capture_output=True, check=False
    )
    if archive.returncode:
        return "The history of this clone does not hold version 0.1.0, so that it was not run."
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as files:
            files.extractall(folder, filter="data")
        runs: dict[Path, list[dict[str, float]]] = {Path(folder): [], ROOT: []}
        for _ in range(ROUNDS):
            for root, found in runs.items():
                found.append(_seconds(root))
    before, now = (
        {name: min(run[name] for run in found) for name in TASKS} for found in runs.values()
    )
    speed = 1.0 / before["driving"]
    lines = [
        "The goals in seconds and per second were set for a machine on which version 0.1.0 finds "
        f"{GOALS_MACHINE:,.0f} equilibria of a driving wheel in a second. On this one it finds "
        f"{speed:,.0f}, in the same run as below, so that this machine takes "
        f"{GOALS_MACHINE / speed:.1f} times as long. Processor time of one core, fastest of "
        f"{ROUNDS} processes of each version, which took turns.",
        "",
        "| processor time | version 0.1.0 | this version | times faster | goal |",
        "|---|---:|---:|---:|---:|",
    ]
    for name, task in TASKS.items():
        cells = [f"{s[name] * task.scale:.3g} {task.unit}" for s in (before, now)]
        ratio = before[name] / now[name]
        lines.append(f"| {task.name} | {' | '.join(cells)} | {ratio:.2g} | {task.goal} |")
    return "\n".join(lines)


def _seconds(root: Path) -> dict[str, float]:
    """Seconds of the tasks by the version in a folder, in a process of its own."""
    done = subprocess.run(
        [sys.executable, str(Path(__file__).with_name("former_tasks.py"))],
        cwd=root,
        env=os.environ | {"PYTHONPATH": str(root), "ORT_DISABLE_TELEMETRY": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    taken: dict[str, float] = json.loads(done.stdout)
    return taken


if __name__ == "__main__":
    print(table())
