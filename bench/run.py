"""All benches: `python bench/run.py NAME ...`; `runner.py` says what a run keeps and writes."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / folder) for folder in ("bench", "tests")]
#: Modules that declare benches, in the order in which they run.
MODULES = (
    "forward_model",
    "peers",
    "sets",
    "faults_on_board",
    "model_errors",
    "streams",
    "slip_unknown",
    "soil_maps",
    "board",
    "c_files",
    "pull_bands",
    "adapt",
    "gap_bench",
)

if __name__ == "__main__":
    from runner import Bench, main

    found = [own for name in MODULES for own in vars(import_module(name)).values()]
    main([own for own in found if isinstance(own, Bench)])
