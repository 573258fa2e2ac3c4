"""Stages that gap analyses state for causes that they cannot name, beside the true ones.

python bench/gap_stages.py                               tier C, outside the catalogue
python bench/gap_stages.py --tiers A B L --unnamed       others, whose names are taken away
python bench/gap_stages.py --seed 0 1 --every 4 --keep stages.json

Set OMP_NUM_THREADS=1 and OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from gap_case import read_model

from datagen.blind_sets.blind_set import draw_blind_set
from datagen.blind_sets.plans import Plan, active_mechanisms, benchmark_plans
from soilml.cli.progress import progress_bar
from soilml.gap import gap
from soilml.io.atomic_files import save_text
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS
from soilml.processes import process_map

NONE = "none stated"
#: Stage of a mechanism by the stage of the simulator at which it acts.
STAGES = {
    "arc": "contact geometry",
    "shape": "normal stress",
    "pressure": "normal stress",
    "shear": "shear stress",
    "driven": "slip or load",
}
#: Stage, or channel, of mechanisms that act on the soil or on the forces.
OTHERS = {
    "slip-sinkage": "normal stress",
    "multipass": "normal stress",
    "vibration": "shear stress",
    "bulldozing": "drawbar_pull",
    "load-transfer": "slip or load",
    "stick-slip": "torque",
    "ripple": "sinkage",
    "cable-drag": "drawbar_pull",
    "bearing-friction": "torque",
    "torque-gain": "torque",
    "torque-offset": "torque",
    "drawbar-gain": "drawbar_pull",
    "drawbar-offset": "drawbar_pull",
    "sinkage-gain": "sinkage",
    "sinkage-offset": "sinkage",
}


def true_stage(plan: Plan) -> str:
    """The stage of a plan's mechanism; empty for one that acts at several, and without one."""
    mechanisms = active_mechanisms(plan.tier, plan.cause)
    if len(mechanisms) != 1:
        return ""
    (own,) = mechanisms
    acts = {stage for field, stage in STAGES.items() if getattr(own, field) is not None}
    others = own.force or own.reading or own.soil
    if own.name in OTHERS:
        return OTHERS[own.name]
    return acts.pop() if len(acts) == 1 and not others else ""


def stated(unnamed: bool, plan: Plan) -> dict[str, Any]:
    """What the report of a plan's set states, beside the truth.

    unnamed: Whether the analysis has no effect, so that no cause is in its catalogue.
    """
    drawn = draw_blind_set(plan)
    case = read_model(drawn.model)
    effects = {} if unnamed else EFFECTS
    report = gap(case, Table(dict(drawn.columns)), effects=effects, seed=0)
    cause = report.remainder_cause
    record = asdict(plan) | {"status": report.status, "true": true_stage(plan), "stated": NONE}
    if cause is not None:
        record |= {"stated": cause.stage, "depends_on": cause.depends_on}
        record |= {"probability": cause.probability, "gain": cause.predictive_gain}
    return record


def chosen(seed: int, tiers: Sequence[str], every: int) -> list[Plan]:
    """Sets of these tiers with all channels, of mechanisms whose stage is known."""
    plans = [p for p in benchmark_plans(seed) if p.design == "sweep" and p.tier in tiers]
    return [p for p in plans if true_stage(p)][seed % every :: every]


def summary(records: Sequence[dict[str, Any]]) -> list[str]:
    """A confusion table of the sets with a gap, and how often a stated stage is right."""
    with_gap = [r for r in records if r["status"] not in ("no-gap", "bad-data")]
    told = [r for r in with_gap if r["stated"] != NONE]
    right = sum(r["stated"] == r["true"] for r in told)
    names = sorted({r["true"] for r in with_gap} | {r["stated"] for r in told})
    count = Counter((r["true"], r["stated"]) for r in with_gap)
    lines = [f"| true stage | {' | '.join(names)} | {NONE} |"]
    lines.append("|---|" + "---:|" * (len(names) + 1))
    lines += [
        f"| {true} | {' | '.join(str(count[true, own]) for own in (*names, NONE))} |"
        for true in names
        if any(key[0] == true for key in count)
    ]
    share = f"right in {right / len(told):.2f}" if told else "none is right"
    return [*lines, "", f"{len(with_gap)} sets with a gap; stated in {len(told)}, {share} of these"]


def main() -> None:
    """Run the sets, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, nargs="+", default=list(range(8)))
    parser.add_argument("--tiers", nargs="+", default=["C"])
    parser.add_argument("--every", type=int, default=4, help="one set in so many")
    parser.add_argument("--unnamed", action="store_true", help="without any effect to name")
    parser.add_argument("--jobs", type=int, help="processes (default: all cores)")
    parser.add_argument("--keep", type=Path, help="write the records to this file")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    plans = [p for seed in args.seed for p in chosen(seed, args.tiers, args.every)]
    records = []
    task = partial(stated, args.unnamed)
    with (
        progress_bar("analysing", len(plans)) as done,
        process_map(task, plans, args.jobs) as results,
    ):
        for record in results:
            records.append(record)
            done(len(records))
            if args.keep is not None:
                save_text(args.keep, json.dumps(records, indent=1))
    print("\n".join(summary(records)))


if __name__ == "__main__":
    main()
