"""The five source papers: their chains with pictures, findings, and printed numbers.

python examples/papers/run.py            what `make demo-papers` runs, into demo/papers
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

HERE, OUT = Path(__file__).parent, Path("demo/papers")
#: Scripts in the order of the papers, and what each shows.
SCRIPTS = {
    "chains": "rim sensors, climbs, strides and a track: each one command on a log",
    "tracked_robot": "plateaus, what grousers add, and eight groups of pulls",
    "lunar_lssvm": "what one reading on lunar soil tells",
}


def run() -> None:
    """Each script in a process of its own; then the numbers."""
    started = time.perf_counter()
    OUT.mkdir(parents=True, exist_ok=True)
    for script, shown in SCRIPTS.items():
        print(f"\n== {script}.py: {shown}", flush=True)
        done = subprocess.run([sys.executable, str(HERE / f"{script}.py")])
        if done.returncode != 0:
            sys.exit(f"{script}.py failed with status {done.returncode}")
    print("\n== All printed numbers beside the computed ones: soilml paper numbers", flush=True)
    words = ["paper", "numbers", "--out", str(OUT / "papers.csv")]
    done = subprocess.run([sys.executable, "-m", "soilml", *words])
    print(f"\n{time.perf_counter() - started:.0f} s; pictures: {OUT}")
    sys.exit(done.returncode)


if __name__ == "__main__":
    run()
