"""What the model file of a gap analysis predicts with its remainder: of rows kept back at random.

python bench/gap_hybrid.py                     sets to tune on, at 0, 2 and 4 % discrepancy
python bench/gap_hybrid.py --seed 1 2 --sets 20 --keep records.json
python bench/gap_hybrid.py --seed 10 11 --sets 10 --write   the page, of sets not tuned on

Set OMP_NUM_THREADS=1 and OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from benchmarks_file import write_page
from gap_case import read_model

from datagen.blind_sets.blind_set import draw_blind_set
from datagen.blind_sets.plans import Plan, benchmark_plans
from soilml.cli.progress import progress_bar
from soilml.config.case import Case
from soilml.fitting.operating_points import operating_points
from soilml.fitting.predictions import forces
from soilml.gap import gap
from soilml.io.atomic_files import save_text
from soilml.io.table import Table
from soilml.processes import process_map
from soilml.quantities import CHANNELS, column

#: Every so many rows are kept back, at random.
ONE_IN = 4
LEVELS = (0.0, 0.02, 0.04)
#: Tiers with a hidden effect: of the catalogue, of another simulator, outside the catalogue.
TIERS = ("A", "B", "C", "D")
#: Distance of the soil alone from the truth, in noise, from which there is a gap to learn.
LEFT = 1.0
#: Margins by which a model may be worse than the better of effect and process.
MARGINS = (0.05, 0.25)
SECTION = "What the returned model predicts"
PARTS = {"kept": "rows kept back at random", "heavier": "rows at a heavier load"}


def compared(plan: Plan) -> dict[str, Any]:
    """RMS distance to the truth, in noise, of what each method predicts for rows it has not seen.

    The truth is without noise and scatter, with effect and discrepancy.
    """
    drawn = draw_blind_set(plan)
    runs, region = Table(dict(drawn.columns)), Table(dict(drawn.region))
    case = read_model(drawn.model)
    kept = np.random.default_rng(plan.seed).permutation(len(runs)) < len(runs) // ONE_IN
    learned = runs.rows(~kept)
    report = gap(case, learned, seed=0)
    record: dict[str, Any] = asdict(plan) | {"status": report.status}
    if not report.soil_before:
        return record
    soil = case.with_values({k: v.value for k, v in report.soil_before.items()})
    model = report.model
    steady, extra = drawn.truth["runs_steady"], drawn.truth["discrepancy"]["runs"]
    truth = {k: np.asarray(steady[k]) + np.asarray(extra[k]) for k in steady}
    heavy = {k: np.asarray(v) for k, v in drawn.truth["region_true"].items()}
    for part, rows, true in (
        ("kept", runs.rows(kept), {k: v[kept] for k, v in truth.items()}),
        ("heavier", region, heavy),
    ):
        found = {
            "soil": predicted(soil, rows),
            "effect": predicted(replace(model, remainder=None), rows),
            "hybrid": predicted(model, rows),
            "process": process_of_readings(case, learned, rows),
            "soil + process": process_of_readings(case, learned, rows, soil),
        }
        record[part] = {label: distance(case, y, true, runs) for label, y in found.items()}
    return record


def predicted(case: Case, rows: Table) -> dict[str, np.ndarray]:
    """Predictions (rows,) of each channel, with the mean of the remainder."""
    force = forces(case, operating_points(rows))
    return {name: np.asarray(getattr(force, name)) for name in CHANNELS}


def distance(
    case: Case, y: Mapping[str, np.ndarray], true: Mapping[str, np.ndarray], runs: Table
) -> float:
    """RMS distance to the truth in the declared noise, over the measured channels."""
    off = [
        (y[name] - true[column(name)]) / case.noise[column(name)].std(true[column(name)])
        for name in CHANNELS
        if name in y and np.isfinite(runs[column(name)]).any()
    ]
    return float(np.sqrt(np.mean(np.square(np.nan_to_num(off, nan=10.0)))))


def process_of_readings(
    case: Case, learned: Table, rows: Table, soil: Case | None = None
) -> dict[str, np.ndarray]:
    """Predictions of a Gaussian process of the readings, or of what the soil leaves of them."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    def features(given: Table) -> np.ndarray:
        own = [given["slip"] / 0.2, np.log(given["load_N"]) / 0.4]
        if "gear" in given:
            own.append(np.unique(given["gear"], return_inverse=True)[1])
        return np.column_stack(own)

    found = {}
    base = predicted(soil, learned) if soil else None
    after = predicted(soil, rows) if soil else None
    for name in CHANNELS:
        known = np.isfinite(learned[column(name)])
        if not known.any():
            continue
        reading = learned[column(name)][known]
        middle = base[name][known] if base else np.full(len(reading), reading.mean())
        scale = float(np.median(case.noise[column(name)].std(reading)))
        width = features(learned).shape[1]
        kernel = ConstantKernel(10.0, (1e-2, 1e6)) * RBF([1.0] * width, (0.2, 20.0))
        process = GaussianProcessRegressor(kernel + WhiteKernel(1.0), random_state=0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            process.fit(features(learned)[known], (reading - middle) / scale)
        own = after[name] if after else reading.mean()
        found[name] = own + scale * process.predict(features(rows))
    return found


def ratios(records: Sequence[Mapping[str, Any]], part: str, of: str, over: str) -> np.ndarray:
    """(n,) ratios of two distances, of sets in which the soil alone leaves a gap."""
    own = [r[part] for r in records if part in r and r[part]["soil"] > LEFT]
    return np.asarray([at[of] / at[over] for at in own])


def against_better(records: Sequence[Mapping[str, Any]]) -> np.ndarray:
    """(n,) distances at heavier loads over those of the better of effect and process."""
    own = [r["heavier"] for r in records if "heavier" in r and r["heavier"]["soil"] > LEFT]
    return np.asarray([at["hybrid"] / min(at["effect"], at["process"]) for at in own])


def kept_promise(records: Sequence[Mapping[str, Any]]) -> str:
    """How often the hybrid is no worse than the better of effect and process, at heavier loads."""
    own = [r["heavier"] for r in records if "heavier" in r and r["heavier"]["soil"] > LEFT]
    ratio = against_better(records)
    within = [f"at most {w:.0%} worse in {np.mean(ratio <= 1.0 + w):.0%}" for w in MARGINS]
    either = [min(at["effect"], at["process"]) / max(at["effect"], at["process"]) for at in own]
    return (
        "Which of effect and process is better at heavier loads is known only afterwards. The "
        f"better one is {np.median(either):.2f} times as far from the truth as the other in the "
        f"median of {len(own)} sets. The hybrid is no worse in {np.mean(ratio <= 1.0):.0%}, "
        f"{', '.join(within)}."
    )


def text(records: Sequence[Mapping[str, Any]]) -> str:
    """Medians and worst sets by the size of the discrepancy."""
    rows = []
    for level in (*LEVELS, None):
        own = [r for r in records if level is None or r["discrepancy"] == level]
        cells = [
            ratios(own, "kept", "hybrid", "soil"),
            ratios(own, "kept", "effect", "soil"),
            ratios(own, "kept", "hybrid", "process"),
            ratios(own, "kept", "hybrid", "soil + process"),
            ratios(own, "heavier", "hybrid", "soil"),
            against_better(own),
        ]
        if not len(cells[0]):
            continue
        shown = [f"{np.median(c):.2f} / {c.max():.2f}" for c in cells]
        rows.append(("all" if level is None else f"{level:.0%}", str(len(cells[0])), *shown))
    head = (
        "discrepancy", "sets", "hybrid over soil", "effect over soil", "hybrid over process",
        "hybrid over soil + process", "heavier: over soil", "heavier: over the better",
    )  # fmt: skip
    lines = [head, ("---",) * len(head), *rows]
    written = "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
    return f"Median / worst set.\n\n{written}\n\n{kept_promise(records)}"


def write(records: Sequence[Mapping[str, Any]], seeds: Sequence[int], sets: int) -> None:
    """Write the page of the benchmarks."""
    command = f"python bench/gap_hybrid.py --seed {' '.join(map(str, seeds))} --sets {sets} --write"
    head = (
        f"Written by `{command}`: blind sets of tiers {', '.join(TIERS)} in which the soil alone "
        "leaves a gap. A quarter of the rows is kept back at random, and rows at 1.3 to 1.6 times "
        "the heaviest load are predicted too. Figures are ratios of RMS distances to the "
        "noise-free readings. *Hybrid* is the returned model with its learned remainder, "
        "*effect* is the same without it, and *process* is a Gaussian process of the readings."
        "\n\nGates: hybrid over soil at "
        "most 0.5 in the median and 1.0 in the worst set; hybrid over process at most 1.0 in the "
        "median at each discrepancy; heavier loads no worse than the better of effect and process."
    )
    write_page("gap-hybrid", (SECTION,), {SECTION: f"{head}\n\n{text(records)}"})


def chosen(seeds: Sequence[int], sets: int) -> list[Plan]:
    """For each seed and level of discrepancy, so many plans of all tiers, evenly spaced."""
    found = []
    for seed in seeds:
        for level in LEVELS:
            own = [p for p in benchmark_plans(seed) if p.tier in TIERS and p.discrepancy == level]
            found += [own[i] for i in np.linspace(0, len(own) - 1, sets).astype(int)]
    return found


def run() -> None:
    """Draw, analyse, compare, print; keep the records where that is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, nargs="+", default=(1,))
    parser.add_argument("--sets", type=int, default=12, help="of each level of discrepancy")
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--keep", metavar="FILE.json")
    parser.add_argument("--write", action="store_true", help="write docs/benchmarks/gap-hybrid.md")
    args = parser.parse_args()
    plans, records = chosen(args.seed, args.sets), []
    with (
        process_map(compared, plans, args.jobs) as found,
        progress_bar(f"comparing {len(plans)} sets", len(plans)) as done,
    ):
        for record in found:
            records.append(record)
            done(len(records))
            if args.keep:
                save_text(args.keep, json.dumps(records))
    print(text(records))
    if args.write:
        write(records, args.seed, args.sets)


if __name__ == "__main__":
    run()
