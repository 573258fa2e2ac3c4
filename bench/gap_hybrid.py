"""What the model file of a gap analysis predicts, with its remainder, of rows kept back."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, replace
from typing import Any

import gap_bench
import numpy as np
from gap_baselines import gaussian_process, process_features
from gap_figures import LEFT
from runner import Bench, Row, Sample, markdown

from datagen.blind_sets.blind_set import draw_blind_set
from datagen.blind_sets.plans import Plan, benchmark_plans
from soilml.config.case import Case
from soilml.fitting.operating_points import operating_points
from soilml.fitting.predictions import forces
from soilml.gap import gap
from soilml.io.table import Table
from soilml.quantities import CHANNELS, column

#: Every so many rows are kept back, at random.
ONE_IN = 4
LEVELS = (0.0, 0.02, 0.04)
#: Tiers with a hidden effect, or with a smooth discrepancy alone.
TIERS = ("A", "B", "C", "D")
#: Seeds that nothing was tuned on, and one to tune on; sets of each level of discrepancy.
SEEDS, QUICK_SEED, SETS, QUICK_SETS = (10, 11), 1, 10, 2
#: Margins by which a model may be worse than the better of effect and process.
MARGINS = (0.05, 0.25)
ABOUT = (
    f"Blind sets of tiers {', '.join(TIERS)} in which the soil alone leaves a gap. A quarter of "
    "the rows is kept back at random, and rows at 1.3 to 1.6 times the heaviest load are predicted "
    "too. Figures are ratios of RMS distances to the noise-free readings. *Hybrid* is the returned "
    "model with its learned remainder, *effect* is the same without it, and *process* is a "
    "Gaussian process of the readings.\n\nGates: hybrid over soil at most 0.5 in the median and "
    "1.0 in the worst set; hybrid over process at most 1.0 in the median at each discrepancy; "
    "heavier loads no worse than the better of effect and process."
)


def cases(sample: Sample) -> list[Row]:
    """For each seed and level of discrepancy, some plans of all tiers, evenly spaced."""
    found, count = [], QUICK_SETS if sample.quick else SETS
    for seed in sample.seeds or ((QUICK_SEED,) if sample.quick else SEEDS):
        for level in LEVELS:
            own = [p for p in benchmark_plans(seed) if p.tier in TIERS and p.discrepancy == level]
            found += [asdict(own[i]) for i in np.linspace(0, len(own) - 1, count).astype(int)]
    return found


def compared(asked: Row) -> Row:
    """RMS distance to the truth, in noise, of what each method predicts for rows it has not seen.

    The truth is without noise and scatter, with effect and discrepancy.
    """
    plan = Plan(**{f.name: asked[f.name] for f in fields(Plan)})
    drawn = draw_blind_set(plan)
    (case, runs), region = gap_bench.given(drawn), Table(dict(drawn.region))
    kept = np.random.default_rng(plan.seed).permutation(len(runs)) < len(runs) // ONE_IN
    learned = runs.rows(~kept)
    report = gap(case, learned, seed=0)
    record: Row = {"status": report.status}
    if not report.soil_before:
        return record
    soil = case.with_values({k: v.value for k, v in report.soil_before.items()})
    steady, extra = drawn.truth["runs_steady"], drawn.truth["discrepancy"]["runs"]
    truth = {k: np.asarray(steady[k]) + np.asarray(extra[k]) for k in steady}
    measured = [n for n in CHANNELS if np.isfinite(runs[column(n)]).any()]
    for part, rows, true in (
        ("kept", runs.rows(kept), {k: v[kept] for k, v in truth.items()}),
        ("heavier", region, drawn.truth["region_true"]),
    ):
        found = {
            "soil": predicted(soil, rows),
            "effect": predicted(replace(report.model, remainder=None), rows),
            "hybrid": predicted(report.model, rows),
            "process": process_of_readings(case, learned, rows),
            "soil + process": process_of_readings(case, learned, rows, soil),
        }
        record[part] = {
            label: gap_bench.distance(case, y, true, [n for n in measured if n in y])
            for label, y in found.items()
        }
    return record


def predicted(case: Case, rows: Table) -> dict[str, np.ndarray]:
    """Predictions (rows,) of each channel, with the mean of the remainder."""
    force = forces(case, operating_points(rows))
    return {name: np.asarray(getattr(force, name)) for name in CHANNELS}


def process_of_readings(
    case: Case, learned: Table, rows: Table, soil: Case | None = None
) -> dict[str, np.ndarray]:
    """Predictions of a Gaussian process of the readings, or of what the soil leaves of them."""
    names = [name for name in ("slip", "load_N", "gear") if name in learned]
    features = process_features(Table({name: learned[name] for name in names}))
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
        process = gaussian_process(features(learned).shape[1])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            process.fit(features(learned)[known], (reading - middle) / scale)
        own = after[name] if after else reading.mean()
        found[name] = own + scale * process.predict(features(rows))
    return found


def with_gap(records: Sequence[Row], part: str) -> list[Mapping[str, Any]]:
    """Distances of sets in which the soil alone leaves a gap."""
    return [r[part] for r in records if part in r and r[part]["soil"] > LEFT]


def tables(records: Sequence[Row]) -> str:
    """Medians and worst sets by the size of the discrepancy."""
    rows = []
    for level in (*LEVELS, None):
        own = [r for r in records if level is None or r["discrepancy"] == level]
        kept, heavier = with_gap(own, "kept"), with_gap(own, "heavier")
        if not kept:
            continue
        over = (("hybrid", "soil"), ("effect", "soil"), ("hybrid", "process"))
        cells = [[at[a] / at[b] for at in kept] for a, b in (*over, ("hybrid", "soil + process"))]
        cells += [[at["hybrid"] / at["soil"] for at in heavier], against_better(heavier)]
        shown = [f"{np.median(c):.2f} / {max(c):.2f}" for c in cells]
        rows.append(("all" if level is None else f"{level:.0%}", str(len(kept)), *shown))
    head = (
        "discrepancy", "sets", "hybrid over soil", "effect over soil", "hybrid over process",
        "hybrid over soil + process", "heavier: over soil", "heavier: over the better",
    )  # fmt: skip
    return f"Median / worst set.\n\n{markdown(head, rows)}\n\n{kept_promise(records)}"


def against_better(heavier: Sequence[Mapping[str, Any]]) -> list[float]:
    """Distances at heavier loads over those of the better of effect and process."""
    return [at["hybrid"] / min(at["effect"], at["process"]) for at in heavier]


def kept_promise(records: Sequence[Row]) -> str:
    """How often the hybrid is no worse than the better of effect and process, at heavier loads."""
    own = with_gap(records, "heavier")
    ratio = np.asarray(against_better(own))
    within = [f"at most {w:.0%} worse in {np.mean(ratio <= 1.0 + w):.0%}" for w in MARGINS]
    either = [min(at["effect"], at["process"]) / max(at["effect"], at["process"]) for at in own]
    return (
        "Which of effect and process is better at heavier loads is known only afterwards. The "
        f"better one is {np.median(either):.2f} times as far from the truth as the other in the "
        f"median of {len(own)} sets. The hybrid is no worse in {np.mean(ratio <= 1.0):.0%}, "
        f"{', '.join(within)}."
    )


GAP_HYBRID = Bench(
    "gap-hybrid", "Gap workflow: rows kept back", ABOUT, cases, compared, tables, long=True
)
