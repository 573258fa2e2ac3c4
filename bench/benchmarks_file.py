"""Where the measured figures are written."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).parents[1]
FILE = ROOT / "BENCHMARKS.md"
#: Separates the part that `make bench` writes (before) from that of `make bench-gap` (after).
MARK = "\n<!-- written by make bench-gap -->\n"


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
