"""Seconds of a gap analysis and of the averaged answer of `identify`, on blind sets."""

from __future__ import annotations

import cProfile
import pstats
from collections.abc import Iterator
from itertools import islice

import gap_bench
import numpy as np
from core_speed import SOLVES, timed
from runner import Bench, Row, Sample, table

from datagen.blind_sets.blind_set import BlindSet, draw_blind_set
from datagen.blind_sets.plans import benchmark_plans
from soilml import identify
from soilml.gap import gap

SEED = 1  # Of the plans: sets to tune on
SETS, QUICK_SETS = 24, 2  # Of each size
#: Sets of each size in which calls of Python functions are counted, which takes three times as long
COUNTED = 3
#: Rows in all, and design; those that `identify` is timed on; gates of median and longest in
#: scaled seconds.
SIZES = {64: "sweep", 200: "sweep", 5: "few-rows"}
IDENTIFIED = (64, 5)
GATES = {
    ("gap", 64): (1.0, 4.0),
    ("gap", 200): (3.0, None),
    ("gap", 5): (1.0, None),
    ("identify", 64): (1.0, 3.0),
}
ABOUT = (
    "Seconds of one core, raw and for a core that makes "
    f"{SOLVES:,} forward solutions of the wheel in a second. The sets are those of the blind "
    "benchmark, of a seed to tune on, one after the other. Goal of `identify`: a median of 1 s "
    "for 64 rows."
)


def cases(sample: Sample) -> list[Row]:
    """Analyses of the sets of each size, numbered."""
    count = QUICK_SETS if sample.quick else SETS
    calls = [("gap", size) for size in SIZES] + [("identify", size) for size in IDENTIFIED]
    return [
        {"of": of, "size": n, "design": SIZES[n], "sets": count, "call": f"{of}, {n} rows"}
        for of, n in calls
    ]


def measured(case: Row) -> list[Row]:
    """Seconds of each set, and calls of Python functions in some."""
    analyse = {
        "gap": lambda model, rows: gap(model, rows, seed=0),
        "identify": identify,
    }[case["of"]]
    analyse(*gap_bench.given(next(sets(64, "sweep"))))  # libraries are loaded
    found = []
    for number, drawn in enumerate(islice(sets(case["size"], case["design"]), case["sets"])):
        model, rows = gap_bench.given(drawn)
        work = timed(model, lambda model=model, rows=rows: analyse(model, rows))
        found.append({"seconds": work.seconds, "scaled": work.scaled})
        if number < COUNTED and case["of"] == "gap":
            profile = cProfile.Profile()
            profile.runcall(analyse, model, rows)
            found[-1]["calls"] = int(pstats.Stats(profile).total_calls)  # type: ignore[attr-defined]
    return found


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


def tables(rows: list[Row]) -> str:
    """Median, 90 % quantile and longest of each size, with their gates."""

    def figures(member):  # type: ignore[no-untyped-def]
        def cell(own: list[Row]) -> str:
            seconds = [row[member] for row in own]
            ends = np.median(seconds), np.quantile(seconds, 0.9), max(seconds)
            return ", ".join(f"{s:.2f}" for s in ends)

        return cell

    def gate(own: list[Row]) -> tuple[float | None, float | None]:
        return GATES.get((own[0]["of"], own[0]["size"]), (None, None))

    def gate_text(own: list[Row]) -> str:
        median, longest = gate(own)
        text = f"<= {median:g}" if median else ""
        return text + (f", longest <= {longest:g}" if longest else "")

    def met(own: list[Row]) -> str:
        (median, longest), scaled = gate(own), [row["scaled"] for row in own]
        if median is None:
            return ""
        fine = float(np.median(scaled)) <= median and (longest is None or max(scaled) <= longest)
        return "yes" if fine else "**no**"

    def calls(own: list[Row]) -> str:
        counted = [row["calls"] for row in own if "calls" in row]
        return f"{np.median(counted):,.0f}" if counted else ""

    columns = {
        "sets": len,
        "raw: median, 90 %, longest": figures("seconds"),
        "scaled: median, 90 %, longest": figures("scaled"),
        "gate": gate_text,
        "met": met,
        "Python calls": calls,
    }
    return table(rows, {"call": "call"}, columns)


GAP_SPEED = Bench(
    "gap-speed", "Gap workflow and averaged answer: seconds", ABOUT, cases, measured, tables,
    timed=True, long=True,
)  # fmt: skip
