"""One blind set, analysed, and compared with its truth."""

from __future__ import annotations

import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import gap_baselines
import numpy as np
from core_speed import timed
from gap_separation import separation

from datagen.blind_sets.blind_set import BlindSet, draw_blind_set
from datagen.blind_sets.plans import Plan
from soilml.config.case import Case, read_case
from soilml.fitting.operating_points import operating_points
from soilml.gap import GapReport, gap
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS
from soilml.quantities import CHANNELS, SHEAR, column
from soilml.remarks import texts

#: The covariate of effects that follow the order of the rows.
ORDER = "progress"
#: The other methods are run on one set in so many.
EVERY = 8
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


def judged(job: tuple[int, Plan]) -> dict[str, Any]:
    """The record of one plan: what was hidden, what was said, and how far it is from the truth."""
    number, plan = job
    drawn = draw_blind_set(plan)
    table = Table(dict(drawn.columns))
    truth = tuple(sorted(cause["name"] for cause in drawn.truth["causes"]))
    record: dict[str, Any] = asdict(plan) | {
        "truth": truth,
        "catalogued": bool(truth) and {n.partition("@")[0] for n in truth} <= set(EFFECTS),
        "relatives": _relatives(plan.tier, plan.cause, truth),
        "rows": len(table),
        "signal": 0.0,
        "snr": 0.0,
    }
    try:
        case = read_model(drawn.model)
        apart = separation(case, table, drawn.truth)
        record |= {"signal": apart.signal, "snr": apart.snr, "rival": apart.rival}
        analysis = timed(case, lambda: gap(case, table, seed=0))
    except Exception as error:  # a crash is a finding of the benchmark, not its end
        return record | {"status": "crash", "sentence": f"{type(error).__name__}: {error}"}
    report = analysis.result
    record |= {"seconds": analysis.seconds, "solves": analysis.solves} | _said(report)
    if report.soil_before:
        record |= _compared(number, case, report, table, drawn, truth)
    return record


def _relatives(tier: str, cause: str, truth: tuple[str, ...]) -> list[str]:
    """Effects that are right too: of the law's family, or `SAME_CAUSE`."""
    if tier in ("C", "T"):
        return SAME_CAUSE.get(cause, [])
    families = {getattr(EFFECTS[n].about, "family", "") for n in truth if n in EFFECTS} - {""}
    if tier != "L" or not families:
        return []
    return [n for n, e in EFFECTS.items() if getattr(e.about, "family", "") in families]


def read_model(model: str) -> Case:
    """The case in the text of a model file."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "model.toml"
        file.write_text(model)
        return read_case(file)


def _said(report: GapReport) -> dict[str, Any]:
    """What the report states."""
    return {
        "status": report.status,
        "sentence": report.sentence,
        "cause_set": [tuple(sorted(names)) for names in report.cause_set],
        "probabilities": dict(getattr(report, "probabilities", {})),
        "suspects": [tuple(sorted(s.effects)) for s in getattr(report, "suspects", ())],
        "gap_probability": report.gap_probability,
        "unclaimed": list(report.best_unclaimed),
        "reasons": texts(report.reasons),
        "gap": {k: (s.before, s.after) for k, s in report.gap.items()},
        "beside_remainder": {
            k: (s.before, s.after) for k, s in getattr(report, "gap_beside_remainder", {}).items()
        },
        "codes": sorted({r.code for r in (*report.reasons, *report.notes, *report.conditions)}),
    }


def _compared(
    number: int,
    case: Case,
    report: GapReport,
    table: Table,
    drawn: BlindSet,
    truth: tuple[str, ...],
) -> dict[str, Any]:
    """Soil and held-out rows beside the truth, and the other methods on some sets."""
    soil = drawn.truth["soil"]
    measured = tuple(n for n in CHANNELS if np.isfinite(table[column(n)]).any())
    soil_only = case.with_values({k: v.value for k, v in report.soil_before.items()})
    compared: dict[str, Any] = {
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
    models = {"soil": soil_only, "named": report.model}
    plain_design = len(measured) == len(CHANNELS) and "gear" not in table
    if number % EVERY == 0 and plain_design:
        compared["naming"] = gap_baselines.names(soil_only, table, case)
        if truth and set(truth) <= set(EFFECTS):
            own = {name: EFFECTS[name] for name in truth}
            models["oracle"] = gap(case, table, effects=own, seed=0).model
    parts = {"region": drawn.region, "between": drawn.between}
    rows = [
        Table(dict(columns) | {ORDER: np.asarray(drawn.truth[f"{part}_elapsed"])})
        for part, columns in parts.items()
    ]
    learned = gap_baselines.learned(case, table, _predicted(soil_only, table), rows, measured)
    for i, (part, at) in enumerate(zip(parts, rows, strict=True)):
        target = drawn.truth[f"{part}_true"]
        predicted = {label: _predicted(model, at) for label, model in models.items()}
        for label, values in learned.items():
            added = values[i]
            if label in gap_baselines.BESIDE_SOIL:
                added = {name: predicted["soil"][name] + added[name] for name in measured}
            predicted[label] = added
        compared[part] = {label: _rms(case, y, target, measured) for label, y in predicted.items()}
    return compared


def _predicted(case: Case, table: Table) -> dict[str, np.ndarray]:
    """Predictions of a case for every row, by channel; of each gear for its own rows."""
    if "gear" in table:
        y = {name: np.full(len(table), np.nan) for name in CHANNELS}
        for gear in case.gears:
            own = table["gear"] == gear
            for name, values in _predicted(case.of_gear(gear), _without_gear(table, own)).items():
                y[name][own] = values
        return y
    at = operating_points(table)
    force = case.model(case.soil, at)
    if (remainder := getattr(case, "remainder", None)) is not None:
        force = remainder.added_to(force, at.slip, at.load)
    return {name: np.asarray(getattr(force, name)) for name in CHANNELS}


def _without_gear(table: Table, own: np.ndarray) -> Table:
    """The rows of one gear, without the column that names it."""
    columns = {name: values for name, values in table.columns.items() if name != "gear"}
    return Table(columns).rows(own)


def _rms(
    case: Case, y: dict[str, np.ndarray], target: dict[str, Any], measured: tuple[str, ...]
) -> float:
    """RMS distance of predictions to the noise-free readings, in the declared noise."""
    off = []
    for name in measured:
        true = np.asarray(target[column(name)])
        off.append((y[name] - true) / case.noise[column(name)].std(true))
    return float(np.sqrt(np.mean(np.square(np.nan_to_num(off, nan=10.0)))))
