"""One hidden set, analysed, and judged against its truth."""

from __future__ import annotations

import tempfile
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

import gap_baselines
import numpy as np

from datagen.blind_sets.blind_set import draw_blind_set
from datagen.blind_sets.factorial_plan import Plan
from soilml.config.case import Case, read_case
from soilml.gap import GapReport, gap
from soilml.identification.operating_points import operating_points
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS
from soilml.quantities import CHANNELS, column

#: A wrong name is added on purpose to every so many sets, and the baselines are run there.
EVERY = 8


def judged(job: tuple[int, Plan]) -> dict[str, Any]:
    """Everything that the benchmark wants to know of one plan."""
    number, plan = job
    drawn = draw_blind_set(plan)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "model.toml"
        file.write_text(drawn.model)
        case = read_case(file)
    table, region = Table(dict(drawn.columns)), Table(dict(drawn.region))
    started = time.process_time()
    report = gap(case, table, seed=0)
    seconds = time.process_time() - started
    truth = tuple(sorted(cause["name"] for cause in drawn.truth["causes"]))
    soil_only = _soil_only(case, report)
    found: dict[str, Any] = asdict(plan) | {
        "truth": truth,
        "status": report.status,
        "cause_set": [tuple(sorted(names)) for names in report.cause_set],
        "snr": min((e.separating_snr for e in report.effects), default=0.0),
        "p_gap": report.p_gap,
        "seconds": seconds,
        "gap": {k: (s.before, s.after) for k, s in report.gap.items()},
    }
    if not report.gap:
        return found
    target = drawn.truth["region_true"]
    distance = {"soil": _distance(case, soil_only, region, target)}
    distance["named"] = _distance(case, report.model, region, target)
    soil = drawn.truth["soil"]
    found["soil"] = {
        name: (
            report.soil_before[name].value - soil[name],
            report.soil_after[name].value - soil[name],
            soil[name],
        )
        for name in ("friction_angle", "shear_modulus")
        if name in report.soil_before
    }
    if number % EVERY == 0:
        distance |= _others(case, report, table, region, target, soil_only, truth)
        found["naming"] = gap_baselines.names(soil_only, table, case)
    found["region"] = distance
    return found


def _soil_only(case: Case, report: GapReport) -> Case:
    return case.with_values({k: v.value for k, v in report.soil_before.items()})


def _predicted(case: Case, table: Table) -> dict[str, np.ndarray]:
    force = case.model(case.soil, operating_points(table))
    return {name: np.asarray(getattr(force, name)) for name in CHANNELS}


def _distance(case: Case, model: Case, table: Table, target: dict[str, Any]) -> float:
    """RMS distance of predictions to the noise-free truth, in the declared noise."""
    return _rms(case, _predicted(model, table), target)


def _rms(case: Case, y: dict[str, np.ndarray], target: dict[str, Any]) -> float:
    off = []
    for name in CHANNELS:
        true = np.asarray(target[column(name)])
        off.append((y[name] - true) / case.noise[column(name)].std(true))
    return float(np.sqrt(np.mean(np.square(np.nan_to_num(off, nan=10.0)))))


def _others(
    case: Case,
    report: GapReport,
    table: Table,
    region: Table,
    target: dict[str, Any],
    soil_only: Case,
    truth: tuple[str, ...],
) -> dict[str, float]:
    """The same distance for other ways to close the gap: a wrong name, the oracle, regressions."""
    found = {}
    if set(truth) & set(EFFECTS):
        own = {name: EFFECTS[name] for name in truth if name in EFFECTS}
        oracle = gap(case, table, effects=own, seed=0)
        found["oracle"] = _distance(case, oracle.model, region, target)
    rejected = [
        t for t in report.candidates if t.verdict.startswith("rejected") and len(t.names) == 1
    ]
    if rejected:
        name = rejected[0].names[0]
        wrong = gap(case, table, effects={name: EFFECTS[name]}, seed=0)
        best = _grown_anyway(wrong, soil_only)
        found["wrong name"] = _distance(case, best, region, target)
        found["wrong name, gap closed in training"] = _closed(wrong)
    plain_train, plain_region = _predicted(soil_only, table), _predicted(soil_only, region)
    for label, learned in gap_baselines.remainders(case, table, plain_train, region).items():
        y = {name: plain_region[name] + learned[name] for name in CHANNELS}
        found[label] = _rms(case, y, target)
    return found


def _grown_anyway(report: GapReport, soil_only: Case) -> Case:
    return report.model if report.effects else soil_only


def _closed(report: GapReport) -> float:
    """Share of the gap's power in training that an explanation removed."""
    train = report.gap["train"]
    return (train.before - train.after) / max(train.before - 1.0, 1e-9)
