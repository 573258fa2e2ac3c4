"""Where the measured figures are written."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[1]
FILE = ROOT / "BENCHMARKS.md"
#: Separates the part that `make bench` writes (before) from that of `make bench-gap` (after).
MARK = "\n<!-- written by make bench-gap -->\n"
