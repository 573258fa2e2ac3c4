"""Wall time of make targets."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]


def wall_time(target: str) -> str:
    """Wall time (s) of a make target, in an environment that is installed already."""
    subprocess.run(["make", ".venv/.ready"], cwd=ROOT, capture_output=True, check=False)
    started = time.perf_counter()
    done = subprocess.run(["make", target], cwd=ROOT, capture_output=True, check=False)
    state = "" if done.returncode == 0 else " (failed)"
    return f"| `make {target}` | {time.perf_counter() - started:.0f}{state} |"


def table() -> str:
    """Wall time of the demonstration and of the tests."""
    return "\n".join(["| | seconds |", "|---|---:|", wall_time("demo"), wall_time("test")])
