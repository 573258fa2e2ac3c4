"""Where the benchmarks are written."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[1]
FILE = ROOT / "BENCHMARKS.md"
#: In front of the part that `make bench-gap` writes; what stands before is that of `make bench`.
MARK = "\n<!-- written by make bench-gap -->\n"
