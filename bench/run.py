"""All benches: `python bench/run.py NAME ...`; see `runner.py` for what a run keeps and writes."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "bench"), str(ROOT), str(ROOT / "tests"), str(ROOT / "tools")]

from gap_bench import GAP
from gap_hybrid import GAP_HYBRID
from gap_speed import GAP_SPEED
from runner import main

BENCHES = (GAP, GAP_HYBRID, GAP_SPEED)

if __name__ == "__main__":
    main(BENCHES)
