"""The board: latency of an estimate, cold start, and what it weighs."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from soilml import Estimator

ROOT = Path(__file__).parents[1]
CALLS = 4000
OUTPUTS = ("mean", "std", "covariance", "in_range")
COLD = """
import time; t = time.perf_counter()
from soilml.onboard import Estimator
e = Estimator.load({path!r}); e(slip=0.3, torque=3.0, load=60.0)
t = time.perf_counter() - t
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(t, int(status["VmRSS"].split()[0]) / 1024)
"""


def latency() -> str:
    """Median and 99th percentile of one estimate: the runtime alone, and through `Estimator`."""
    lines = [
        "| file | runtime alone, us | p99 | Estimator, us | p99 | run of 16 readings, us |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for file in sorted((ROOT / "exported").glob("wheel*.onnx")):
        estimator = Estimator.load(file)
        feed = {n: np.asarray([v], np.float32) for n, v in _reading().items()}
        many = {n: np.full(16, v) for n, v in _reading().items()}
        raw = _timed(lambda e=estimator, f=feed: e.session.run(OUTPUTS, f))
        whole = _timed(lambda e=estimator: e(**_reading()))
        joint = _timed(lambda e=estimator, m=many: e.run(**m), CALLS // 8)
        lines.append(
            f"| {file.name} | {raw[0]:.0f} | {raw[1]:.0f} | {whole[0]:.0f} | {whole[1]:.0f} "
            f"| {joint[0]:.0f} |"
        )
    return "\n".join(lines)


def cold_start() -> str:
    """Import, load, check and first estimate in a fresh process."""
    path = str(ROOT / "exported" / "wheel.onnx")
    found = []
    for _ in range(5):
        done = subprocess.run(
            [sys.executable, "-c", COLD.format(path=path)],
            capture_output=True,
            text=True,
            check=True,
        )
        found.append([float(x) for x in done.stdout.split()])
    seconds, memory = np.min(found, axis=0)
    return (
        f"Import, load, checksums, probe and first estimate: {seconds:.3f} s (best of 5), "
        f"{memory:.0f} MB resident."
    )


def _reading() -> dict[str, float]:
    return {"slip": 0.3, "torque": 3.0, "load": 60.0}


def _timed(call, count: int = CALLS) -> tuple[float, float]:  # type: ignore[no-untyped-def]
    for _ in range(50):
        call()
    taken = np.empty(count)
    for i in range(count):
        started = time.perf_counter()
        call()
        taken[i] = time.perf_counter() - started
    return float(np.median(taken) * 1e6), float(np.quantile(taken, 0.99) * 1e6)
