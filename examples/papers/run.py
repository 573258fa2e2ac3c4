"""Every system of the source papers, example by example: what `make demo-papers` runs."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent


def run() -> None:
    """Each example in a process of its own, in order of name; then the table of numbers."""
    started = time.perf_counter()
    for example in sorted(file for file in HERE.glob("*.py") if file.name != "run.py"):
        print(f"\n== {example.stem.replace('_', ' ')} ==", flush=True)
        done = subprocess.run([sys.executable, str(example)])
        if done.returncode != 0:
            sys.exit(f"{example.name} failed with status {done.returncode}")
    print("\n== soilml papers ==", flush=True)
    table = "demo/papers/papers.csv"
    done = subprocess.run([sys.executable, "-m", "soilml", "papers", "--out", table])
    print(f"\n{time.perf_counter() - started:.0f} s; pictures are in demo/papers")
    sys.exit(done.returncode)


if __name__ == "__main__":
    run()
