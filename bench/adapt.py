"""What `soilml adapt` gives a board whose wheel does something that its model lacks.

    python bench/adapt.py                     the table of hidden effects, resumed in build/adapt
    python bench/adapt.py --only slip-sinkage --seeds 5
    python bench/adapt.py --quick --write     the same in docs/benchmarks/adapt.md
    python bench/adapt.py limit [--write]     what the exact posterior gains by knowing the effect
    python bench/adapt.py campaign DIR        the log, model and soil of one world, for a trial

Each world is a campaign of 64 rows of a blind set, whose simulator shares no code with the package,
with an effect that the model file lacks. `adapt` sees the campaign alone. Its two files then
estimate 40 other soils of the same bearing values from 16 torque readings each, with the same
hidden effect. The error of the board is the root mean square error of c, phi and K over the prior's
standard deviation; after the adaptation the board has the file that `adapt` recommends. The old
file has two answers, its own and that with its model taken as right. Each file's answer is its own
in the columns of errors; the last two columns are the error after over that of either of the two.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks_file import write_page
from gap_records import table

from datagen.blind_sets import Plan, draw_blind_set, write_blind_set
from datagen.blind_sets.plans import active_mechanisms
from datagen.blind_sets.reading_errors import sensors
from datagen.blind_sets.reference_wheel import WheelState, solve_equilibrium
from datagen.blind_sets.soil_families import FAMILIES, PRIOR, RADIUS, WIDTH
from soilml import Estimator, adapt, identify, read_case, read_table
from soilml.physics.effects import EFFECTS
from soilml.quantities import SHEAR, column
from training.set_posterior import validation

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Hidden effects, by tier and key of the blind sets, at their reference sizes.
WORLDS = (
    ("A", "slip-sinkage"),
    ("A", "exit-angle"),
    ("A", "grousers"),
    ("A", "bulldozing"),
    ("A", "stress-shift"),
    ("A", "sidewall-shear"),
    ("A", "shear-softening"),
    ("B", "slip-sinkage/square"),
    ("S", "torque-gain"),
    ("C", "stiff-layer"),
)
SEEDS = (5, 6)
NOISE, RUNS, FAMILY, FREE = 0.02, 4, "dry-sand", 3
SOILS, ROWS = 40, 16  # Soils after the campaign, and torque readings of each
TRAINING_ROWS = 40_000
#: Sets of each size for the limits of misfit and for the figures of the cards, with --quick; and
#: synthetic rows, from which only the estimates of single rows are learned.
QUICK_SETS, QUICK_ROWS = (400, 40), 10_000
#: Answers: name, model file, and what it is told of errors of its model.
ANSWERS = (
    ("before", "before", {}),
    ("before, model right", "before", {"model_error": 0.0}),
    ("adapted", "adapted", {}),
)
WORLDS_SECTION, LIMIT_SECTION = "Twenty campaigns", "How much can be gained at most"
WORLDS_HEAD = """\
Written by `python bench/adapt.py --quick --write`. Twenty campaigns of 64 rows in four runs, of a \
simulator that shares no code with soilml, with an effect hidden in each. Then 40 other soils with \
the same effect give 16 torque readings each, at the loads of the campaign.

The columns *before*, *before, model right* and *adapted* have root mean square errors of c, phi \
and K, and coverage of their 90 % intervals. *Kept back* is the ratio of errors that `adapt` \
states itself, against the better of the two answers of the old file. Errors are then taken over \
the prior's standard deviations. The last two columns have that of the recommended file, \
over that of the old file by its own answer, and with its model taken as right. They are 1 where \
it stays.

"""
LIMIT_HEAD = """\
Written by `python bench/adapt.py limit --write`: error of the exact posterior of the same soils \
from the same readings, without the hidden effect and with it at its true size. Effects of the \
catalogue alone.

"""


@dataclass(frozen=True)
class Outcome:
    """One world: verdicts, and the board's figures with the old and with the adapted file."""

    world: str
    seed: int
    status: str
    gap_status: str
    effects: list[str]
    ratio: float | None  # error on the runs kept back, after over before; as `adapt` states it
    #: by answer, over prior standard deviations, root mean square over parameters
    errors: dict[str, float]
    rmse: dict[str, list[float]]  # by answer, SI
    coverage: dict[str, list[float]]  # of 90 % intervals
    width: dict[str, float]  # of 90 % intervals over the prior's, mean over parameters
    out_of_range: dict[str, float]

    def ratio_to(self, answer: str) -> float:
        """Error with the file that `adapt` recommends over that of an answer of the old file."""
        return self.errors["adapted"] / self.errors[answer] if self.status == "adapted" else 1.0


def plan_of(tier: str, key: str, seed: int, noise: float = NOISE, runs: int = RUNS) -> Plan:
    """The plan of a world."""
    return Plan(tier, key, 1.0, noise, runs, FAMILY, FREE, seed=seed)


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
        rows = WheelState.on_soil(own, slip, load, RADIUS, WIDTH)
        found = solve_equilibrium(rows, active)
        torque = found.torque + noise.std(found.torque) * rng.standard_normal(ROWS)
        if np.isfinite(torque).all():
            sets.append({"slip": slip, "load": load, "torque": torque})
            truth.append([own[name] for name in SHEAR])
    return sets, np.asarray(truth)


def measure(
    estimator: Estimator, sets: list[Any], truth: Floats
) -> tuple[Floats, Floats, float, float]:
    """Rmse (3,) in SI, coverage (3,) of 90 % intervals, their width, share of sets out of range."""
    found = [estimator.run(**readings) for readings in sets]
    mean, low, high = (np.stack([getattr(e, k) for e in found]) for k in ("mean", "low", "high"))
    rmse = np.sqrt(np.mean((mean - truth) ** 2, axis=0))
    covered = np.mean((truth >= low) & (truth <= high), axis=0)
    width = float(np.mean((high - low) / (0.9 * (estimator.prior.upper - estimator.prior.lower))))
    return rmse, covered, width, float(np.mean([not e.in_range for e in found]))


def run_world(tier: str, key: str, seed: int, rows: int, folder: Path) -> Outcome:
    """Adapt to one world and measure the board on other soils; kept where it is there already."""
    plan, place = plan_of(tier, key, seed), folder / f"{key.replace('/', '-')}-{seed}"
    record = place / "outcome.json"
    if record.exists():
        return Outcome(**json.loads(record.read_text()))
    write_blind_set(plan, place / "data", place / "truth")
    truth = json.loads((place / "truth/truth.json").read_text())
    table = read_table(place / "data/runs.csv")
    report = adapt(
        read_case(place / "data/model.toml"), table, place / "out",
        rows=rows, seed=seed, workers=1,
    )  # fmt: skip
    rmse, coverage, width, outside, errors = {}, {}, {}, {}, {}
    if report.judgement is not None:
        sets, true = board_sets(plan, truth["soil"], np.unique(table["load_N"]))
        std = np.asarray([np.diff(PRIOR[name])[0] for name in SHEAR]) / np.sqrt(12.0)
        for name, file, told in ANSWERS:
            estimator = Estimator.load(place / "out" / f"{file}.onnx").on(**told)
            own, covered, width[name], outside[name] = measure(estimator, sets, true)
            rmse[name], coverage[name] = own.tolist(), covered.tolist()
            errors[name] = float(np.sqrt(np.mean((own / std) ** 2)))
    outcome = Outcome(
        world=key, seed=seed, status=report.status, gap_status=report.gap_status,
        effects=list(report.effects),
        ratio=None if report.judgement is None else report.judgement.ratio,
        errors=errors, rmse=rmse, coverage=coverage, width=width, out_of_range=outside,
    )  # fmt: skip
    record.write_text(json.dumps(asdict(outcome), indent=1) + "\n")
    return outcome


def table_of(outcomes: list[Outcome]) -> str:
    """A line for each world, and the figures over all of them."""
    rows = [
        (
            f"{o.world}, {o.seed}", o.gap_status, "+".join(o.effects), o.status,
            "" if o.ratio is None else f"{o.ratio:.2f}",
            *(_figures(o.rmse[n], o.coverage[n]) if o.rmse else "" for n, _, _ in ANSWERS),
            *(f"{o.ratio_to(n):.2f}" for n, _, _ in ANSWERS[:2]),
        )
        for o in outcomes
    ]  # fmt: skip
    head = (
        "hidden effect, seed", "gap", "added", "verdict", "kept back",
        *(n for n, _, _ in ANSWERS), "after/before", "after/model right",
    )  # fmt: skip
    changed = np.asarray([o.status == "adapted" for o in outcomes])
    over = []
    for name, _, _ in ANSWERS[:2]:
        ratios = np.asarray([o.ratio_to(name) for o in outcomes])
        median = f"{np.median(ratios[changed]):.3f}" if changed.any() else ""
        worse = f"{(ratios > 1.0).sum()}"
        over.append((f"error after over {name}", f"{np.median(ratios):.3f}", median, worse))
    count = f"{len(outcomes)} worlds, of which {changed.sum()} adapted"
    parts = [table(head, rows), table((count, "median, all", "median, adapted", "worse"), over)]
    trained = [o for o in outcomes if o.errors]
    if trained:
        covered = [
            (
                name,
                _percent(np.mean([o.coverage[name] for o in trained], axis=0)),
                _percent([np.min([o.coverage[name] for o in trained])]),
                f"{np.mean([o.width[name] for o in trained]):.2f}",
            )
            for name, _, _ in ANSWERS
        ]
        head = (f"answer, in {len(trained)} worlds", "coverage", "least", "width over the prior's")
        parts.append(table(head, covered))
    return "\n".join(parts).rstrip()


def _figures(rmse: list[float], coverage: list[float]) -> str:
    c, phi, shear = rmse
    return f"{c:.0f} Pa, {np.rad2deg(phi):.1f}°, {1e3 * shear:.1f} mm; {_percent(coverage)}"


def _percent(shares: Iterable[float]) -> str:
    return "/".join(f"{100 * share:.0f}" for share in shares) + " %"


def limit_table(soils: int = 20) -> str:
    """Error of the exact posterior that knows the hidden effect, over that of one without it.

    No adapted file can gain more. Effects of the catalogue alone; soils as in the worlds.
    """
    lines, ratios = [], []
    std = np.asarray([np.diff(PRIOR[name])[0] for name in SHEAR]) / np.sqrt(12.0)
    for seed, (tier, key) in ((s, w) for s in SEEDS for w in WORLDS if w[1] in EFFECTS):
        plan = plan_of(tier, key, seed)
        blind = draw_blind_set(plan)
        soil = {name: float(value) for name, value in blind.truth["soil"].items()}
        with tempfile.TemporaryDirectory() as folder:
            write_blind_set(plan, Path(folder) / "data", Path(folder) / "truth")
            case = read_case(Path(folder) / "data/model.toml").with_values(soil)
            loads = np.unique(read_table(Path(folder) / "data/runs.csv")["load_N"])
        ((mechanism, size),) = (
            (m, plan.size * m.reference) for m in active_mechanisms(plan.tier, plan.cause)
        )
        known = replace(case, model=case.model + EFFECTS[key](**{mechanism.size: size}))
        sets, truth = board_sets(plan, soil, loads)
        errors = []
        for own in (case, known):
            fits = [
                identify(own, {column(k): v for k, v in one.items()}, SHEAR, "posterior")
                for one in sets[:soils]
            ]
            off = np.asarray([fit.values for fit in fits]) - truth[:soils]
            errors.append(float(np.sqrt(np.mean((off / std) ** 2))))
        ratios.append(errors[1] / errors[0])
        cells = (key, str(seed), f"{errors[0]:.3f}", f"{errors[1]:.3f}", f"{ratios[-1]:.2f}")
        print("  ".join(cells), file=sys.stderr, flush=True)
        lines.append(cells)
    head = ("hidden", "seed", "error without the effect", "with it", "ratio")
    median = f"median of the ratio: {np.median(ratios):.2f}"
    return f"{table(head, lines)}\n{median}"


def write_campaign(folder: Path) -> None:
    """Log, model and true soil of a world with hidden slip-sinkage."""
    plan = plan_of("A", "slip-sinkage", SEEDS[0])
    write_blind_set(plan, folder, folder / "truth")
    soil = draw_blind_set(plan).truth["soil"]
    lines = [f"{name} = {value!r}" for name, value in soil.items()]
    (folder / "true_soil.toml").write_text("\n".join(["[soil]", *lines]) + "\n")


def main() -> None:
    """Print the table, or write a campaign."""
    if sys.argv[1:2] == ["campaign"]:
        write_campaign(Path(sys.argv[2]))
        return
    if sys.argv[1:2] == ["limit"]:
        found = limit_table()
        print(found)
        if "--write" in sys.argv:
            write_page(
                "adapt", (WORLDS_SECTION, LIMIT_SECTION), {LIMIT_SECTION: LIMIT_HEAD + found}
            )
        return
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", help="keys of hidden effects")
    parser.add_argument("--seeds", nargs="*", type=int, default=SEEDS)
    parser.add_argument("--out", type=Path, default=Path("build/adapt"))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument(
        "--quick",
        action="store_true",
        help="fewer rows, and fewer sets for the limits of misfit and for the figures of the cards",
    )
    parser.add_argument("--write", action="store_true", help="write docs/benchmarks/adapt.md")
    args = parser.parse_args()
    if args.quick:
        validation.LIMIT_SETS, validation.FIGURE_SETS = QUICK_SETS
    rows = QUICK_ROWS if args.quick else TRAINING_ROWS
    worlds = [(t, k, s) for s in args.seeds for t, k in WORLDS if not args.only or k in args.only]
    with ProcessPoolExecutor(args.processes) as pool:
        futures = [pool.submit(run_world, t, k, s, rows, args.out) for t, k, s in worlds]
        outcomes = []
        for future in futures:
            outcomes.append(future.result())
            print(table_of(outcomes[-1:]).splitlines()[2], file=sys.stderr, flush=True)
    print(table_of(outcomes))
    if args.write:
        text = WORLDS_HEAD + table_of(outcomes)
        write_page("adapt", (WORLDS_SECTION, LIMIT_SECTION), {WORLDS_SECTION: text})


if __name__ == "__main__":
    main()
