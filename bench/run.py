"""Measure everything that the documents claim, and write BENCHMARKS.md: `make bench`."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import board
import learning
import physics
import systems
from place import FILE, MARK, ROOT

from soilml.saving import save_text


def machine() -> str:
    """Processor, cores and versions."""
    name = platform.processor() or platform.machine()
    cpu = Path("/proc/cpuinfo")
    if cpu.exists():
        names = [x.split(":")[1].strip() for x in cpu.read_text().splitlines() if "model name" in x]
        name = names[0] if names else name
    libraries = ("numpy", "scipy", "scikit-learn", "torch", "onnx", "onnxruntime", "pyarrow")
    versions = ", ".join(f"{n} {version(n).split('+')[0]}" for n in libraries)
    return (
        f"{name}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}, Python "
        f"{platform.python_version()}; {versions}. One thread for each process."
    )


def wall_time(target: str) -> str:
    """Seconds that a make target takes once the environment is there."""
    subprocess.run(["make", ".venv/.ready"], cwd=ROOT, capture_output=True, check=False)
    started = time.perf_counter()
    done = subprocess.run(["make", target], cwd=ROOT, capture_output=True, check=False)
    state = "" if done.returncode == 0 else " (failed)"
    return f"| `make {target}` | {time.perf_counter() - started:.0f}{state} |"


def sections(folder: Path) -> list[tuple[str, str, str]]:
    """(title, what it shows, measured text) of every part."""
    parts: list[tuple[str, str, str]] = []

    def part(title: str, about: str, text: str) -> None:
        parts.append((title, about, text))
        print(f"{title} ... done", file=sys.stderr, flush=True)

    part(
        "Accuracy of the rigid wheel",
        "Against adaptive quadrature and bracketing (tests/reference.py), over c 0-6 kPa, phi "
        "15-50 deg, K 2-60 mm, n 0.4-1.6, k 4e4-1e7 N/m^(n+2), load 5-1000 N, r 0.04-0.5 m, "
        "b 0.02-0.4 m. Goal: 1e-6 relative.",
        physics.accuracy(),
    )
    part("Speed of the forward model", "Side by side, 200 000 rows.", physics.speed())
    part(
        "Errors, coverage and time of every method",
        "The reference wheel (examples/wheel): c 0-3 kPa, phi 25-45 deg, K 5-30 mm, slip 0.05-0.6, "
        "load 30-120 N, 2 % torque noise, bearing known; held-out recipe wheel_test. `/prior` is "
        "RMSE over the prior's standard deviation. One reading alone cannot fix three parameters: "
        "all methods stay near the prior there, and their intervals say so. Several readings fix "
        "them, and there least squares on the full model is far ahead of joined single-reading "
        "estimates.",
        learning.comparison(folder),
    )
    part(
        "Fusion rules for regressors of the same reading",
        "LS-SVM, MLP and line read the same three numbers and err together. Inverse-variance and "
        "the pairwise rule take them for independent and cover far less than they claim; the "
        "default (best-linear: non-negative, under the shrunk correlation of the errors, "
        "recalibrated) does not. Prior alone: 1.419 in -log p.",
        learning.rules(),
    )
    part("Parity of the exported files", "Goal: 1e-4.", learning.parity())
    part(
        "Centres that the inverse problem needs",
        "One reading is limited by information, not by the model.",
        learning.centres(folder),
    )
    part("Closed-form leave-one-out", "", learning.leave_one_out())
    part("Latency on board", "One thread.", board.latency() + "\n\n" + board.cold_start())
    part(
        "Other gears",
        "50 000 rows each, loads that the gear is made for, side by side.",
        systems.gears(),
    )
    part(
        "Walking wheel-legs",
        "Feet none, LTF, SRF, CIF on five legs, and 2, 3 and 6 legs without feet. Goal: a turn "
        "in under 5 s. Differences are the largest of any case to the paper's step of 1e-4 s.",
        systems.walking(),
    )
    part(
        "Bands of climbing ability",
        "60 simulated rovers a line whose ground is known, each slope driven four times: share of "
        "truths inside the 90 % band, error over claimed std (1 is right). Pull at slip 0.4.",
        systems.climbing(),
    )
    times = "\n".join(["| | seconds |", "|---|---:|", wall_time("demo"), wall_time("test")])
    part("Wall time", "With the environment made.", times)
    return parts


def run() -> None:
    """Measure and write."""
    with tempfile.TemporaryDirectory() as folder:
        parts = sections(Path(folder))
    text = "# Benchmarks\n\nWritten by `make bench`; nothing here is typed by hand.\n\n"
    text += f"Machine: {machine()}\n"
    for title, about, body in parts:
        text += f"\n## {title}\n\n" + (f"{about}\n\n" if about else "") + f"{body}\n"
    _, mark, gap = FILE.read_text().partition(MARK) if FILE.exists() else ("", "", "")
    save_text(FILE, text + mark + gap)
    print(f"BENCHMARKS.md written ({len(parts)} parts)")


if __name__ == "__main__":
    run()
