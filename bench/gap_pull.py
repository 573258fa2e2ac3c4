"""What the model that `gap` returns predicts: coverage of `pull`'s bands, and the soil alone."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any

import numpy as np
from gap_bench import given
from gap_figures import CATALOGUED_TIERS
from runner import Bench, Row, Sample, table

from datagen.blind_sets.blind_set import draw_blind_set
from datagen.blind_sets.plans import Plan, benchmark_plans
from soilml.config.case import Case
from soilml.fitting.mixtures import without_faults
from soilml.fitting.simulation import simulate
from soilml.gap import gap
from soilml.io.table import Table
from soilml.numerics.quantiles import quantile_band
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, column
from soilml.traction.soil_draws import measured_soil

#: Seeds that nothing was tuned on, and one of so many of their plans.
SEEDS, EVERY = (10, 11), 6
#: Seed of a quick look, and one of so many plans.
QUICK_SEED, QUICK_EVERY = 1, 12
DESIGNS = ("sweep", "few-runs", "jittered", "repeats", "unequal-soils", "missing-channels")
#: Places of `beyond_schedule`.
PLACES = ("inside", "lighter", "heavier", "faster")
#: Error in noise below which nothing is left to improve, and ratio that counts as worse.
LEFT, WORSE = 1.0, 1.05
ABOUT = (
    "Sets of datagen/blind_sets whose causes are in the catalogue or not. `gap` analyses the rows, "
    "`pull` predicts with the returned model and the same rows. Truth is the pull of a vehicle: "
    "no fault of rig or sensor, the smooth discrepancy included. Worse: the mean of the returned "
    "model (all channels, noise units) is farther from the truth than the soil alone by 5 % and "
    "farther than the noise."
)


def cases(sample: Sample) -> list[Row]:
    """Plans of one gear and several loads."""
    seeds = sample.seeds or ((QUICK_SEED,) if sample.quick else SEEDS)
    plans = [p for s in seeds for p in benchmark_plans(s) if p.design in DESIGNS]
    every = QUICK_EVERY if sample.quick else EVERY
    return [asdict(p) for p in plans[:: every if not sample.seeds else QUICK_EVERY]]


def judged(asked: Row) -> Row:
    """Bands and means of one plan beside the truth."""
    plan = Plan(**{f.name: asked[f.name] for f in fields(Plan)})
    drawn = draw_blind_set(plan)
    case, rows = given(drawn)
    truth = drawn.truth["beyond"]
    where, slip, load = (np.asarray(truth[k]) for k in ("where", "slip", "load_N"))
    true = {n: np.asarray(truth["true"][column(n)]) for n in CHANNELS}
    known = truth["covariates"]
    carried = np.isfinite(true["drawbar_pull"])
    report = gap(case, rows, seed=0)
    if not report.soil_before:
        return {"status": report.status}
    soil_only = case.with_values({k: v.value for k, v in report.soil_before.items()})
    measured = [n for n in CHANNELS if np.isfinite(rows[column(n)]).any()]
    off = {}
    for label, model in (("soil", soil_only), ("model", report.model)):
        found = simulate(model, slip, load, **known)
        off[label] = np.sqrt(
            np.mean(
                [
                    ((np.nan_to_num(found[column(n)], nan=1e3) - true[n])
                     / case.noise[column(n)].std(true[n])) ** 2
                    for n in measured
                ],
                axis=0,
            )
        )  # fmt: skip
    bands = _bands(report.model, rows, slip, load, known)
    inside = (bands[0] <= true["drawbar_pull"]) & (true["drawbar_pull"] <= bands[1])
    miss = np.maximum(bands[0] - true["drawbar_pull"], 0) + np.maximum(
        true["drawbar_pull"] - bands[1], 0
    )
    score = (bands[1] - bands[0] + 20.0 * miss) / load
    row: Row = {"status": report.status, "catalogued": plan.tier in CATALOGUED_TIERS}
    row["alone"] = not plan.cause
    for place in PLACES:
        own = (where == place) & carried
        if not own.any():
            continue
        row[f"cover {place}"] = float(np.mean(inside[own]))
        row[f"score {place}"] = float(np.mean(score[own]))
        for label in off:
            row[f"{label} {place}"] = float(np.sqrt(np.mean(off[label][own] ** 2)))
    own = carried & (where != "faster")
    row["cover"], row["score"] = float(np.mean(inside[own])), float(np.mean(score[own]))
    return row


def _bands(model: Case, rows: Table, slip: Any, load: Any, known: Row) -> Any:
    """Ends (2, n) of the 90 % bands of pull at slips and loads (n,), as `pull` draws them."""
    soil = measured_soil(model, rows)
    draws, _ = soil.with_errors(slip, load, ("drawbar_pull",))
    count = len(draws.values)
    draw, at = (grid.ravel() for grid in np.indices((count, len(slip))))
    there = Operating(slip=slip[at], load=load[at], **known)
    found = draws.forces(without_faults(soil.case), draw, there).drawbar_pull
    band = quantile_band(np.reshape(np.asarray(found), (count, len(slip))))
    return np.asarray([band.lower, band.upper])


def tables(rows: list[Row]) -> str:
    """Coverage, score and share of worse predictions, by group."""
    groups = {"catalogued": "catalogued", "none": "no cause", "outside": "outside the catalogue"}
    named = [
        r
        | {
            "group": groups[
                "none" if r.get("alone") else "catalogued" if r["catalogued"] else "outside"
            ]
        }
        for r in rows
        if "cover" in r
    ]

    def mean(key: str) -> Any:
        return lambda own: f"{np.mean([r[key] for r in own if key in r]):.3f}"

    def worse(place: str) -> Any:
        def text(own: list[Row]) -> str:
            judged_ = [r for r in own if f"model {place}" in r]
            bad = [
                r for r in judged_ if r[f"model {place}"] > max(WORSE * r[f"soil {place}"], LEFT)
            ]
            return f"{len(bad)}/{len(judged_)}"

        return text

    columns: dict[str, Any] = {"sets": len, "coverage": mean("cover")}
    columns["worst set"] = lambda own: f"{min(r['cover'] for r in own):.2f}"
    columns["below .6"] = lambda own: sum(r["cover"] < 0.6 for r in own)
    columns |= {f"cover {p}": mean(f"cover {p}") for p in PLACES}
    columns["score / load"] = mean("score")
    columns |= {f"worse {p}": worse(p) for p in PLACES}
    return table(named, {"cause": "group"}, columns, "all")


GAP_PULL = Bench(
    "gap-pull", "Predictions of the model that gap returns", ABOUT, cases, judged, tables, long=True
)
