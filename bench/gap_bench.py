"""The gap workflow on blind sets with hidden effects: each is analysed and compared with its truth.

python bench/run.py gap                      739 sets, an hour on two cores; records are kept
python bench/run.py gap --quick              a look at sets of a seed to tune on
python bench/run.py gap --seeds 1 2 --every 3 --only tier=C
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import gap_tables
import numpy as np
from core_speed import timed
from gap_baselines import predicted, process_of
from gap_figures import CATALOGUED_TIERS, FEW_ROWS, GROUPS, NAMEABLE_SIGMA, ONE_LOAD
from gap_separation import separation
from runner import Bench, Row, Sample, thinned

from datagen.blind_sets.blind_set import BlindSet, draw_blind_set
from datagen.blind_sets.plans import Plan, benchmark_plans
from soilml.config.case import Case, read_case
from soilml.fitting.mixtures import without_faults
from soilml.gap import GapReport, gap
from soilml.io.table import Table
from soilml.numerics.quantiles import quantile_band
from soilml.physics.effects import EFFECTS
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, SHEAR, column
from soilml.traction.soil_draws import measured_soil

#: Seeds of the published sets, on which nothing was tuned (0, 1, 2, 3, 4, 5, 7 are those tuned on);
#: one of so many plans is taken, and groups get so many sets with a cause that can be named.
SEEDS, EVERY, LEAST = (10, 11), 3, 60
#: Seed and share of a quick look.
QUICK_SEED, QUICK_EVERY = 1, 20
#: Draws of the plans of few rows and of one load beside the first one, by numbers from that of the
#: seed times 100: one draw of few rows has six or seven with a cause that can be named.
FURTHER_DRAWS = (1, 2)
#: Designs of one gear and several loads, whose models predict pull beyond the driven range.
PULL_DESIGNS = ("sweep", "few-runs", "jittered", "repeats", "unequal-soils", "missing-channels")
#: The covariate of effects that follow the order of the rows.
ORDER = "progress"
#: Causes of another law than the catalogue's that effects name rightly. Both the layer and the firm
#: base are firmer ground at a depth below loose soil, where the pressure rises faster. A soil that
#: changes has the drifts of what changes.
SAME_CAUSE = {
    "stiff-layer": ["firm-base"],
    "trend/friction": ["friction-drift"],
    "trend/bearing": ["bearing-drift"],
    "trend/drying": ["bearing-drift", "cohesion-drift"],
    "trend/both": ["bearing-drift", "friction-drift"],
}


def cases(sample: Sample) -> list[Row]:
    """Plans of the sample, and those beside it that enlarge groups of few sets."""
    if sample.quick:
        plans = [p for s in sample.seeds or (QUICK_SEED,) for p in benchmark_plans(s)]
        return [asdict(p) for p in thinned(plans, QUICK_EVERY)]
    seeds = sample.of(SEEDS)
    drawn = [benchmark_plans(seed) for seed in seeds]
    chosen = [plan for plans in drawn for plan in thinned(plans, EVERY)]
    every = [*(plan for plans in drawn for plan in plans), *further_plans(seeds)]
    more = added(every, chosen, LEAST)
    return [*map(asdict, chosen), *(asdict(plan) | {"added_to": group} for plan, group in more)]


def belongs(plan: Plan, group: str) -> bool:
    """Whether a plan is of a group that is enlarged."""
    return plan.tier in CATALOGUED_TIERS and GROUPS[group](asdict(plan))


def further_plans(seeds: Sequence[int]) -> list[Plan]:
    """The plans of few rows and of one load of the further draws of these seeds."""
    drawn = [p for s in seeds for i in FURTHER_DRAWS for p in benchmark_plans(100 * s + i)]
    return [p for p in drawn if belongs(p, FEW_ROWS) or belongs(p, ONE_LOAD)]


def added(
    plans: Sequence[Plan],
    sample: Sequence[Plan],
    least: int,
    snr: Callable[[Plan], float] | None = None,
) -> Iterator[tuple[Plan, str]]:
    """Plans outside the sample, with their groups, until each has so many that can be named.

    plans: All plans; they are taken in random order.
    snr: The separating SNR of a plan's cause; by default, what its simulated runs show.
    """
    snr = snr or separating_snr
    for group in GROUPS:
        known = [p for p in sample if belongs(p, group)]
        count = sum(snr(p) >= NAMEABLE_SIGMA for p in known)
        left = [p for p in plans if belongs(p, group) and p not in known]
        for i in np.random.default_rng(0).permutation(len(left)):
            if count >= least:
                break
            if snr(left[i]) >= NAMEABLE_SIGMA:
                count += 1
                yield left[i], group


def separating_snr(plan: Plan) -> float:
    """The separating SNR of a plan's cause, before any analysis; 0 where no soil carries it."""
    try:
        drawn = draw_blind_set(plan)
    except RuntimeError:
        return 0.0
    return separation(*given(drawn), drawn.truth).snr


def given(drawn: BlindSet) -> tuple[Case, Table]:
    """What an analyst gets of a set: the case of its model file, and its rows."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "model.toml"
        file.write_text(drawn.model)
        return read_case(file), Table(dict(drawn.columns))


def judged(asked: Row) -> Row:
    """The record of one plan: what was hidden, what was said, and how far it is from the truth."""
    plan = Plan(**{f.name: asked[f.name] for f in fields(Plan)})
    drawn = draw_blind_set(plan)
    truth = sorted(cause["name"] for cause in drawn.truth["causes"])
    record: Row = {
        "truth": truth,
        "catalogued": bool(truth) and {n.partition("@")[0] for n in truth} <= set(EFFECTS),
        "relatives": relatives(plan.tier, plan.cause, truth),
        "rows": len(drawn.columns["slip"]),
        "signal": 0.0,
        "snr": 0.0,
    }
    try:
        case, table = given(drawn)
        apart = separation(case, table, drawn.truth)
        record |= {"signal": apart.signal, "snr": apart.snr}
        report, seconds, solves = timed(case, lambda: gap(case, table, seed=0))
    except Exception as error:  # a crash is a finding of the benchmark, not its end
        return record | {"status": "crash", "sentence": f"{type(error).__name__}: {error}"}
    record |= {"seconds": seconds, "solves": solves} | _said(report)
    if report.soil_before:
        record |= _compared(case, report, table, drawn)
        if plan.design in PULL_DESIGNS:
            record["pull"] = _pull(report.model, table, drawn.truth["beyond"])
    return record


def relatives(tier: str, cause: str, truth: Sequence[str]) -> list[str]:
    """Effects that are right too: of the law's family, or `SAME_CAUSE`."""
    if tier in ("C", "T"):
        return SAME_CAUSE.get(cause, [])
    families = {getattr(EFFECTS[n].about, "family", "") for n in truth if n in EFFECTS} - {""}
    if tier != "L" or not families:
        return []
    return [n for n, e in EFFECTS.items() if getattr(e.about, "family", "") in families]


def _said(report: GapReport) -> Row:
    """What the report states."""
    return {
        "status": report.status,
        "sentence": report.sentence,
        "cause_set": [sorted(names) for names in report.cause_set],
        "probabilities": dict(report.probabilities),
        "suspects": [sorted(s.effects) for s in report.suspects],
        "gap": {k: (s.before, s.after) for k, s in report.gap.items()},
    }


def _compared(case: Case, report: GapReport, table: Table, drawn: BlindSet) -> Row:
    """Soil and held-out rows beside the truth, and what processes predict for these rows."""
    soil = drawn.truth["soil"]
    measured = tuple(n for n in CHANNELS if np.isfinite(table[column(n)]).any())
    soil_only = case.with_values({k: v.value for k, v in report.soil_before.items()})
    compared: Row = {
        "soil": {
            name: {
                "before": report.soil_before[name].value,
                "after": report.soil_after[name].value,
                "std": report.soil_after[name].std,
                "true": soil[name],
            }
            for name in SHEAR
            if name in report.soil_before
        }
    }
    parts = {"region": drawn.region, "between": drawn.between}
    rows = [
        Table(dict(columns) | {ORDER: np.asarray(drawn.truth[f"{part}_elapsed"])})
        for part, columns in parts.items()
    ]
    own = process_of(case, table, rows)
    beside = process_of(case, table, rows, predicted(soil_only, table))
    for i, (part, at) in enumerate(zip(parts, rows, strict=True)):
        y = {"soil": predicted(soil_only, at), "named": predicted(report.model, at)}
        y["process of readings"] = own[i]
        y["Gaussian process"] = {n: y["soil"][n] + beside[i][n] for n in measured}
        target = drawn.truth[f"{part}_true"]
        compared[part] = {label: distance(case, of, target, measured) for label, of in y.items()}
    return compared


def _pull(model: Case, rows: Table, truth: dict[str, Any]) -> dict[str, float]:
    """Share of true pulls inside of 90 % bands by the returned model, as `pull` draws them.

    By place: inside of the driven range, lighter, heavier, faster. Truth is the pull of a vehicle:
    no fault of rig or sensor, the smooth discrepancy included.
    """
    where, slip, load = (np.asarray(truth[k]) for k in ("where", "slip", "load_N"))
    true = np.asarray(truth["true"][column("drawbar_pull")])
    soil = measured_soil(model, rows)
    draws, _ = soil.with_errors(slip, load, ("drawbar_pull",))
    shape = (len(draws.values), len(slip))
    draw, at = (grid.ravel() for grid in np.indices(shape))
    there = Operating(slip=slip[at], load=load[at], **truth["covariates"])
    found = draws.forces(without_faults(soil.case), draw, there).drawbar_pull
    band = quantile_band(np.reshape(np.asarray(found), shape))
    inside = (band.lower <= true) & (true <= band.upper)
    carried = {str(place): (where == place) & np.isfinite(true) for place in np.unique(where)}
    return {place: float(inside[own].mean()) for place, own in carried.items() if own.any()}


def distance(
    case: Case, y: dict[str, np.ndarray], target: dict[str, Any], measured: Sequence[str]
) -> float:
    """RMS distance of predictions to the noise-free readings, in the declared noise."""
    off = []
    for name in measured:
        true = np.asarray(target[column(name)])
        off.append((y[name] - true) / case.noise[column(name)].std(true))
    return float(np.sqrt(np.mean(np.square(np.nan_to_num(off, nan=10.0)))))


GAP = Bench(
    name="gap",
    title="Gap workflow: hidden effects",
    about=gap_tables.ABOUT,
    cases=cases,
    measure=judged,
    tables=gap_tables.tables,
    draw=gap_tables.draw,
    long=True,
)
