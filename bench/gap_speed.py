"""Measure how long a gap analysis takes, and write docs/benchmarks/gap-speed.md.

python bench/gap_speed.py              a table of sets of 64, of 200 and of 5 rows
python bench/gap_speed.py --sets 4     a quick look

The sets are those of the blind benchmark, of seeds to tune on, one after the other in one process.
Set OMP_NUM_THREADS=1 and OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from benchmarks_file import write_page
from core_speed import SOLVES, Timed, timed
from gap_case import read_model
from gap_records import table

from datagen.blind_sets.blind_set import BlindSet, draw_blind_set
from datagen.blind_sets.plans import benchmark_plans
from soilml.gap import GapReport, gap
from soilml.io.table import Table

SECTION = "Seconds of an analysis"
SEED = 1  # Of the plans; see `gap.SEEDS`
SETS = 24  # Sets of each size
#: Sets of each size in which calls of Python functions are counted, which takes three times as long
COUNTED = 3
#: Rows in all, design, and gates of median and longest in seconds at `SOLVES` solutions a second.
SIZES = ((64, "sweep", 1.0, 4.0), (200, "sweep", 3.0, None), (5, "few-rows", 1.0, None))


def run() -> None:
    """Time the sets, print the table; and write it where that is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sets", type=int, default=SETS, help=f"of each size (default: {SETS})")
    parser.add_argument("--write", action="store_true", help="write docs/benchmarks/gap-speed.md")
    args = parser.parse_args()
    analyse(next(sets(64, "sweep")))  # libraries are loaded
    rows = [_row(size, args.sets) for size in SIZES]
    header = ("sets", "raw: median, 90 %, longest", "scaled: median, 90 %, longest", "gate", "met")
    text = (
        f"Written by `python bench/gap_speed.py --sets {args.sets} --write`. Seconds of one core, "
        f"raw and for a core that makes {SOLVES:,} forward solutions of the wheel in a second.\n\n"
        + table((*header, "Python calls"), rows)
    )
    print(text)
    if args.write:
        write_page("gap-speed", (SECTION,), {SECTION: text.strip()})


def _row(size: tuple[int, str, float, float | None], count: int) -> list[str]:
    """The line of the table on sets of one size."""
    number, design, median, longest = size
    drawn_sets = list(islice(sets(number, design), count))
    timed = [analyse(drawn) for drawn in drawn_sets]
    scaled = [t.scaled for t in timed]
    calls = np.median([_python_calls(drawn) for drawn in drawn_sets[:COUNTED]])
    met = float(np.median(scaled)) <= median and (longest is None or max(scaled) <= longest)
    gate = f"<= {median:g}" + (f", longest <= {longest:g}" if longest else "")
    return [
        f"{len(drawn_sets)} of {number} rows",
        _figures([t.seconds for t in timed]),
        _figures(scaled),
        gate,
        "yes" if met else "**no**",
        f"{calls:,.0f}",
    ]


def _figures(seconds: list[float]) -> str:
    return f"{np.median(seconds):.2f}, {np.quantile(seconds, 0.9):.2f}, {max(seconds):.2f}"


def sets(rows: int, design: str) -> Iterator[BlindSet]:
    """Blind sets of a design with so many rows of three channels, in an order by chance."""
    for seed in range(SEED, SEED + 5):
        plans = [plan for plan in benchmark_plans(seed) if plan.design == design]
        for i in np.random.default_rng(seed).permutation(len(plans)):
            try:
                drawn = draw_blind_set(plans[i], rows)
            except RuntimeError:  # an effect so large that no soil carries all rows
                continue
            if rows == 64 or abs(len(drawn.columns["slip"]) - rows) < 0.1 * rows:
                yield drawn


def analyse(drawn: BlindSet) -> Timed[GapReport]:
    """The analysis of a set, timed."""
    case, rows = read_model(drawn.model), Table(dict(drawn.columns))
    return timed(case, lambda: gap(case, rows, seed=0))


def _python_calls(drawn: BlindSet) -> int:
    """How many functions an analysis calls."""
    case, rows = read_model(drawn.model), Table(dict(drawn.columns))
    profile = cProfile.Profile()
    profile.runcall(gap, case, rows, seed=0)
    return int(pstats.Stats(profile).total_calls)  # type: ignore[attr-defined]


if __name__ == "__main__":
    run()
