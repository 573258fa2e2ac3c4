"""Measure the gap workflow on hidden effects, and write its part of BENCHMARKS.md."""

from __future__ import annotations

import argparse
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import gap_pages
from benchmarks_file import FILE, MARK
from gap_case import judged

from datagen.blind_sets.factorial_plan import plan_matrix
from soilml.cli.progress import progress_bar
from soilml.io.atomic_files import save_text


def run() -> None:
    """Draw, analyse, judge, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="0 is the benchmark's own")
    parser.add_argument("--few", action="store_true", help="a quick look, nothing is written")
    parser.add_argument("--every", type=int, default=1, help="take each n-th plan")
    parser.add_argument("--keep", metavar="FILE.json", help="write what was judged")
    args = parser.parse_args()
    plans = plan_matrix(not args.few, args.seed)[:: args.every]
    jobs = list(enumerate(plans))
    sets = []
    with ProcessPoolExecutor(os.cpu_count()) as pool, progress_bar("analysing", len(jobs)) as done:
        for found in pool.map(judged, jobs, chunksize=4):
            sets.append(found)
            done(len(sets))
    if args.keep:
        save_text(args.keep, json.dumps(sets))
    alone = [judged(job)["seconds"] for job in jobs[:: max(1, len(jobs) // 40)]]
    text = gap_pages.text(sets, alone)
    print(text)
    if not args.few and args.every == 1 and args.seed == 0:
        before = FILE.read_text().partition(MARK)[0].rstrip() + "\n" if FILE.exists() else ""
        save_text(FILE, before + MARK + "\n" + text)


if __name__ == "__main__":
    run()
