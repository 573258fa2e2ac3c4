"""Measure everything that the documents claim, and write BENCHMARKS.md: `make bench`."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import advice
import board
import learning
import physics
import prospects
import systems
from place import FILE, MARK, ROOT

from soilml.io.atomic_files import save_text


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


@dataclass(frozen=True)
class Part:
    """A section of BENCHMARKS.md: its name here, title, what it shows, and what measures it."""

    name: str
    title: str
    about: str
    text: Callable[[Path], str]


PARTS = (
    Part(
        "accuracy",
        "Accuracy of the rigid wheel",
        "Against adaptive quadrature and bracketing (tests/reference.py), over c 0-6 kPa, phi "
        "15-50 deg, K 2-60 mm, n 0.4-1.6, k 4e4-1e7 N/m^(n+2), load 5-1000 N, r 0.04-0.5 m, "
        "b 0.02-0.4 m. Goal: 1e-6 relative.",
        lambda folder: physics.accuracy(),
    ),
    Part(
        "speed",
        "Speed of the forward model",
        "Side by side, 200 000 rows.",
        lambda folder: physics.speed(),
    ),
    Part(
        "comparison",
        "Every method beside the Bayes limit",
        "`soilml compare`: the reference wheel (c 0-3 kPa, phi 25-45 deg, K 5-30 mm, slip "
        "0.05-0.6, load 30-120 N, 2 % torque noise, bearing known), sets of recipe `benchmark`. "
        "`/limit` is RMSE over that of the exact posterior on the same sets. One reading alone "
        "cannot fix three parameters: all methods stay near the prior there, and their intervals "
        "say so.",
        lambda folder: learning.comparison(),
    ),
    Part(
        "sets",
        "Set posterior",
        "The released files beside the exact posterior of the same sets (`python bench/sets.py`). "
        "`any_wheel` answers for the reference wheel as `wheel` does, and for wheels, loads, "
        "soils, bearing, noise and bias over all of its range.",
        learning.sets,
    ),
    Part(
        "flags",
        "Foreign readings: what is flagged",
        "",
        lambda folder: learning.flagged(),
    ),
    Part(
        "rules",
        "Fusion rules for regressors of the same reading",
        "LS-SVM, MLP and line read the same three numbers and err together. Inverse-variance and "
        "the pairwise rule take them for independent and cover far less than they claim; the "
        "default (best-linear: non-negative, under the shrunk correlation of the errors, "
        "recalibrated) does not. Prior alone: 1.419 in -log p.",
        lambda folder: learning.rules(),
    ),
    Part("parity", "Parity of the exported files", "Goal: 1e-4.", lambda folder: learning.parity()),
    Part(
        "centres",
        "Centres that the inverse problem needs",
        "One reading is limited by information, not by the model.",
        learning.centres,
    ),
    Part("loo", "Closed-form leave-one-out", "", lambda folder: learning.leave_one_out()),
    Part(
        "board",
        "Latency on board",
        "One thread. Goal: 60 us for one reading and for a set of 16, 0.2 s to the first estimate, "
        "0.5 MB a file.",
        lambda folder: board.latency() + "\n\n" + board.cold_start(),
    ),
    Part(
        "pull",
        "Bands of pull and slope",
        "Share of truths in 90 % bands of drawbar pull and of the steepest slope (docs/pull.md), "
        "over simulated soils.",
        lambda folder: prospects.prospects(),
    ),
    Part(
        "advice",
        "Following the advice",
        "What the next row leaves of the prior's spread when it is the advised one, a repeat, or a "
        "random one (docs/advice.md).",
        lambda folder: "\n\n".join([advice.next_rows(), advice.plans(), advice.from_file()]),
    ),
    Part(
        "gears",
        "Other gears",
        "50 000 rows each, loads that the gear is made for, side by side.",
        lambda folder: systems.gears(),
    ),
    Part(
        "walking",
        "Walking wheel-legs",
        "Feet none, LTF, SRF, CIF on five legs, and 2, 3 and 6 legs without feet. Goal: a turn "
        "in under 5 s. Differences are the largest of any case to the paper's step of 1e-4 s.",
        lambda folder: systems.walking(),
    ),
    Part(
        "climbing",
        "Bands of climbing ability",
        "60 simulated rovers a line whose ground is known, each slope driven four times: share of "
        "truths inside the 90 % band, error over claimed std (1 is right). Pull at slip 0.4.",
        lambda folder: systems.climbing(),
    ),
    Part(
        "time",
        "Wall time",
        "With the environment made.",
        lambda folder: "\n".join(
            ["| | seconds |", "|---|---:|", wall_time("demo"), wall_time("test")]
        ),
    ),
)


def kept() -> dict[str, str]:
    """Sections of the file as it is, by title."""
    before = FILE.read_text().partition(MARK)[0] if FILE.exists() else ""
    found = (section.partition("\n") for section in before.split("\n## ")[1:])
    return {title: body.strip("\n") for title, _, body in found}


def run(names: Sequence[str]) -> None:
    """Measure all parts, or those named, whose sections alone are then replaced; and write."""
    unknown = set(names) - {part.name for part in PARTS}
    if unknown:
        sys.exit(f"no part {', '.join(sorted(unknown))}: {', '.join(p.name for p in PARTS)}")
    texts = kept() if names else {}
    with tempfile.TemporaryDirectory() as folder:
        for part in PARTS:
            if not names or part.name in names:
                about = f"{part.about}\n\n" if part.about else ""
                texts[part.title] = about + part.text(Path(folder))
                print(f"{part.title} ... done", file=sys.stderr, flush=True)
    text = (
        "# Benchmarks\n\nWritten by `make bench` (`python bench/run.py NAME ...` for some of it: "
    )
    text += f"{', '.join(part.name for part in PARTS)}); nothing here is typed by hand.\n\n"
    text += f"Machine: {machine()}\n"
    for part in PARTS:
        if part.title in texts:
            text += f"\n## {part.title}\n\n{texts[part.title]}\n"
    _, mark, gap = FILE.read_text().partition(MARK) if FILE.exists() else ("", "", "")
    save_text(FILE, text + mark + gap)
    print("BENCHMARKS.md written")


if __name__ == "__main__":
    run(sys.argv[1:])
