"""What `soilml adapt` gives a board whose wheel does something that its model lacks.

    python bench/run.py adapt --only key=slip-sinkage
    python bench/adapt.py DIR        the log, model and soil of one world, for a trial

Each world is a campaign of 64 rows of a blind set, whose simulator shares no code with the package,
with an effect that the model file lacks. `adapt` sees the campaign alone. Its two files then
estimate other soils of the same bearing values, with the same hidden effect.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from runner import Bench, Row, Sample, markdown, table

from datagen.blind_sets import Plan, draw_blind_set, write_blind_set
from datagen.blind_sets.plans import active_mechanisms
from datagen.blind_sets.reading_errors import sensors
from datagen.blind_sets.reference_wheel import WheelState, solve_equilibrium
from datagen.blind_sets.soil_families import FAMILIES, PRIOR, RADIUS, WIDTH
from soilml import Estimator, adapt, read_case, read_table
from soilml.quantities import SHEAR, column
from training.set_posterior import validation

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Hidden effects, by key and tier of the blind sets, at their reference sizes.
WORLDS = {
    "slip-sinkage": "A",
    "exit-angle": "A",
    "grousers": "A",
    "bulldozing": "A",
    "stress-shift": "A",
    "sidewall-shear": "A",
    "shear-softening": "A",
    "slip-sinkage/square": "B",
    "torque-gain": "S",
    "stiff-layer": "C",
}
SEEDS = (5, 6)
NOISE, RUNS, FAMILY, FREE = 0.02, 4, "dry-sand", 3
SOILS, ROWS = 40, 16  # Soils after the campaign, and torque readings of each
#: Sets of each size for the limits of misfit and for the figures of the cards, which the verdict
#: does not need; and synthetic rows, from which only the estimates of single rows are learned.
CARD_SETS, TRAINING_ROWS = (400, 40), 10_000
#: Answers: model file, and what it is told of errors of its model.
ANSWERS: dict[str, tuple[str, dict[str, float]]] = {
    "before": ("before", {}),
    "before, model right": ("before", {"model_error": 0.0}),
    "adapted": ("adapted", {}),
}
STD = np.asarray([np.diff(PRIOR[name])[0] for name in SHEAR]) / np.sqrt(12.0)
ABOUT = (
    "Campaigns of 64 rows in four runs, of a simulator that shares no code with soilml, with an "
    f"effect hidden in each. Then {SOILS} other soils with the same effect give {ROWS} torque "
    "readings each, at the loads of the campaign.\n\n"
    "The columns *before*, *before, model right* and *adapted* have root mean square errors of c, "
    "phi and K, and coverage of their 90 % intervals. The old file has two answers, its own and "
    "that with its model taken as right. *Kept back* is the ratio of errors that `adapt` states "
    "itself, against the better of the two. Errors are then taken over the prior's standard "
    "deviations. The last two columns have that of the recommended file, over that of the old file "
    "by its own answer, and with its model taken as right. They are 1 where it stays."
)


def cases(sample: Sample) -> list[Row]:
    """Each hidden effect with each seed."""
    keys = list(WORLDS)[:1] if sample.quick else WORLDS
    return [{"key": key, "seed": seed} for seed in sample.of(SEEDS) for key in keys]


def plan_of(case: Row) -> Plan:
    """The plan of a world."""
    key = case["key"]
    return Plan(WORLDS[key], key, 1.0, NOISE, RUNS, FAMILY, FREE, seed=case["seed"])


def board_sets(plan: Plan, soil: dict[str, float], loads: Floats) -> tuple[list[Any], Floats]:
    """Readings of new soils with the hidden effect, and the true c, phi, K (soils, 3)."""
    rng = np.random.default_rng([plan.seed, 99])
    family, noise = FAMILIES[plan.soil_family], sensors(plan.noise)[column("torque")]
    active = tuple((m, plan.size * m.reference) for m in active_mechanisms(plan.tier, plan.cause))
    sets, truth = [], []
    while len(sets) < SOILS:
        own = soil | {name: float(rng.uniform(*getattr(family, name))) for name in SHEAR}
        slip = np.sort(rng.uniform(0.06, 0.58, ROWS))
        load = rng.choice(loads, ROWS)
        found = solve_equilibrium(WheelState.on_soil(own, slip, load, RADIUS, WIDTH), active)
        torque = found.torque + noise.std(found.torque) * rng.standard_normal(ROWS)
        if np.isfinite(torque).all():
            sets.append({"slip": slip, "load": load, "torque": torque})
            truth.append([own[name] for name in SHEAR])
    return sets, np.asarray(truth)


def measure(estimator: Estimator, sets: list[Any], truth: Floats) -> Row:
    """Rmse (3,) in SI and over the prior's std, coverage (3,) of 90 % intervals, their width."""
    found = [estimator.run(**readings) for readings in sets]
    mean, low, high = (np.stack([getattr(e, k) for e in found]) for k in ("mean", "low", "high"))
    rmse = np.sqrt(np.mean((mean - truth) ** 2, axis=0))
    prior = 0.9 * (estimator.prior.upper - estimator.prior.lower)
    return {
        "rmse": rmse,
        "error": float(np.sqrt(np.mean((rmse / STD) ** 2))),
        "covered": np.mean((truth >= low) & (truth <= high), axis=0),
        "width": float(np.mean((high - low) / prior)),
    }


def one_world(case: Row) -> Row:
    """Adapt to one world and measure the board on other soils."""
    validation.LIMIT_SETS, validation.FIGURE_SETS = CARD_SETS
    plan = plan_of(case)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        write_blind_set(plan, place / "data", place / "truth")
        truth = json.loads((place / "truth/truth.json").read_text())
        rows = read_table(place / "data/runs.csv")
        model = read_case(place / "data/model.toml")
        seed = case["seed"]
        report = adapt(model, rows, place / "out", rows=TRAINING_ROWS, seed=seed, workers=1)
        board = {}
        if report.judgement is not None:
            sets, true = board_sets(plan, truth["soil"], np.unique(rows["load_N"]))
            for name, (file, told) in ANSWERS.items():
                estimator = Estimator.load(place / "out" / f"{file}.onnx").on(**told)
                board[name] = measure(estimator, sets, true)
    return {
        "status": report.status,
        "gap_status": report.gap_status,
        "effects": "+".join(report.effects),
        "kept_back": None if report.judgement is None else report.judgement.ratio,
        "board": board,
    }


def ratio(row: Row, answer: str) -> float:
    """Error with the file that `adapt` recommends over that of an answer of the old file."""
    board = row["board"]
    adapted = row["status"] == "adapted"
    return board["adapted"]["error"] / board[answer]["error"] if adapted else 1.0


def percent(shares: Any) -> str:
    """Shares in per cent."""
    return "/".join(f"{100 * share:.0f}" for share in shares) + " %"


def figures(found: Row) -> str:
    """Errors of c, phi and K, and coverage of their intervals."""
    c, phi, shear = found["rmse"]
    errors = f"{c:.0f} Pa, {np.rad2deg(phi):.1f}°, {1e3 * shear:.1f} mm"
    return f"{errors}; {percent(found['covered'])}"


def tables(rows: list[Row]) -> str:
    """A line for each world, and the figures over all of them."""
    old = list(ANSWERS)[:2]
    lines = [
        (
            f"{r['key']}, {r['seed']}", r["gap_status"], r["effects"], r["status"],
            "" if r["kept_back"] is None else f"{r['kept_back']:.2f}",
            *(figures(r["board"][n]) if r["board"] else "" for n in ANSWERS),
            *(f"{ratio(r, n):.2f}" for n in old),
        )
        for r in rows
    ]  # fmt: skip
    head = (
        "hidden effect, seed", "gap", "added", "verdict", "kept back", *ANSWERS, "after/before",
        "after/model right",
    )  # fmt: skip
    adapted = [r for r in rows if r["status"] == "adapted"]
    over = []
    for name in old:
        every, changed = ([ratio(r, name) for r in own] for own in (rows, adapted))
        median = f"{np.median(changed):.3f}" if changed else ""
        worse = sum(value > 1.0 for value in every)
        over.append((f"error after over {name}", f"{np.median(every):.3f}", median, worse))
    count = f"{len(rows)} worlds, of which {len(adapted)} adapted"
    parts = [markdown(head, lines, len(head))]
    parts.append(markdown((count, "median, all", "median, adapted", "worse"), over))
    if trained := [r for r in rows if r["board"]]:
        boards = [{"answer": n} | r["board"][n] for n in ANSWERS for r in trained]
        columns = {
            "coverage": lambda own: percent(np.mean([b["covered"] for b in own], axis=0)),
            "least": lambda own: percent([np.min([b["covered"] for b in own])]),
            "width over the prior's": lambda own: f"{np.mean([b['width'] for b in own]):.2f}",
        }
        parts.append(table(boards, {f"answer, in {len(trained)} worlds": "answer"}, columns))
    return "\n\n".join(parts)


def write_campaign(folder: Path) -> None:
    """Log, model and true soil of a world with hidden slip-sinkage."""
    plan = plan_of({"key": "slip-sinkage", "seed": SEEDS[0]})
    write_blind_set(plan, folder, folder / "truth")
    soil = draw_blind_set(plan).truth["soil"]
    lines = [f"{name} = {value!r}" for name, value in soil.items()]
    (folder / "true_soil.toml").write_text("\n".join(["[soil]", *lines]) + "\n")


ADAPT = Bench(
    "adapt", "Files for the board before and after an adaptation", ABOUT, cases, one_world, tables,
    long=True,
)  # fmt: skip

if __name__ == "__main__":
    write_campaign(Path(sys.argv[1]))
