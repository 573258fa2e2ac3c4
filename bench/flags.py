"""What is flagged of readings that a model was not made for, beside what could be.

`python bench/flags.py [wheel.onnx any_wheel.onnx]` prints it. To make it a part of BENCHMARKS.md,
add `part("Foreign readings", flags.ABOUT, flags.table())` to `sections` of bench/run.py.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from fits import POINTS, Surface, channels, points, values, weights
from flags_page import ABOUT, CELLS, FALSELY, Cell, heading, short, written
from foreign import Kind, Readings, driven, kinds
from place import ROOT

from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.cli.progress import bar
from soilml.config.case import Case
from soilml.errors import InputError
from training.set_posterior.coordinates import Coordinate
from training.set_posterior.recipe_family import RecipeFamily
from training.set_posterior.wheel_family import ABSENT

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Ways to drive: six slips at six loads; sets have the first rows of a shuffle of them.
SLIP = np.repeat([0.08, 0.14, 0.21, 0.29, 0.38, 0.48], 6)
LOAD = np.tile([40.0, 52.0, 65.0, 79.0, 94.0, 110.0], 6)
SIZES = (1, 6, 16, 32)
#: Sets of each kind and size, and sets without a fault on which limits are measured.
SETS, SOUND = 100, 300
RELEASED = [str(ROOT / "exported" / name) for name in ("wheel.onnx", "any_wheel.onnx")]
#: The recipe's range, and the share of rows that must lie in it.
SLIPS, LOADS, INSIDE = (0.05, 0.6), (30.0, 120.0), 0.9
SHEAR = ("cohesion", "friction_angle", "shear_modulus")
#: Share of sets without a fault that may be flagged.
FALSE = 0.01
#: Sets without a fault in each size.
MANY = 1000
Order = np.ndarray[Any, np.dtype[np.int64]]
KEYS = {"torque": "torque_Nm", "sinkage": "sinkage_m", "drawbar_pull": "drawbar_pull_N"}


@dataclass(frozen=True)
class World:
    """One kind of fault: what is read of many soils, and what explains it."""

    kind: Kind
    truth: Floats  # (sets, 3)
    reads: Readings  # (sets, ways)
    sound: Readings  # what would be read without the fault, of other soils, driven as it is told
    plain: Surface | None  # of the sound model; None where what is told is out of range
    knowing: Surface  # of the model that knows the fault


def spreads(r: Readings, case: Case) -> Readings:
    """Standard deviations that the noise of the recipe gives to readings."""
    return {name: np.asarray(case.noise[key].std(r[name])) for name, key in KEYS.items()}


def noisy(r: Readings, case: Case, seed: int) -> Readings:
    """With the recipe's noise."""
    rng, std = np.random.default_rng(seed), spreads(r, case)
    return r | {k: r[k] + std[k] * rng.standard_normal(std[k].shape) for k in KEYS}


def shuffled(sets: int, seed: int) -> Order:
    """Order (sets, ways) of rows: every slip once, then every slip again at another load."""
    rng = np.random.default_rng(seed)
    loads, slips = (rng.permuted(np.tile(np.arange(6), (sets, 6, 1)), axis=2) for _ in range(2))
    chosen = np.take_along_axis(loads.swapaxes(1, 2), slips, axis=2)  # (sets, turn, place)
    return (6 * slips + chosen).reshape(sets, 36)


def world(kind: Kind, case: Case, axes: Sequence[Coordinate], seed: int) -> World:
    """Draw soils of the prior, drive them, and fit what may explain the readings."""
    real, rng = kind.case(case), np.random.default_rng(seed)
    u = rng.random((SETS + SOUND, 3))
    theta = values(axes, np.stack([a.drawn(u[:, i]) for i, a in enumerate(axes)], axis=1))
    true = driven(real, theta[:SETS], SLIP, LOAD)
    told = kind.told(true)
    slip, load = told["slip"][0], told["load"][0]
    at = points(POINTS, 5)
    spots = values(axes, at)
    knowing = Surface.of(at, channels(kind.told(driven(real, spots, SLIP, LOAD))))
    reads = kind.told(noisy(true, case, seed))
    if np.mean(within(slip, SLIPS) & within(load, LOADS)) < INSIDE:
        return World(kind, theta[:SETS], reads, reads, None, knowing)
    plain = Surface.of(at, channels(driven(case, spots, slip, load)))
    sound = noisy(driven(case, theta[SETS:], slip, load), case, seed + 1)
    return World(kind, theta[:SETS], reads, sound, plain, knowing)


def within(x: Floats, ends: tuple[float, float]) -> Any:
    """Whether it lies in a range."""
    return (x >= ends[0]) & (x <= ends[1])


def picked(r: Readings, kind: Kind | None, order: Order) -> Readings:
    """Rows (sets, rows) in this order, with the faults of rows."""
    own, other = (
        {k: np.take_along_axis(v, order, axis=1) for k, v in source.items()}
        for source in (r, {k: np.roll(v, 1, axis=0) for k, v in r.items()})
    )
    return own if kind is None else kind.rows(own, other)


def misfits(w: World, r: Readings, order: Order, case: Case, three: bool) -> tuple[Floats, Floats]:
    """Least misfit of the sound model, and how much less that of the one that knows, (sets,)."""
    assert w.plain is not None
    full = {k: np.ones((len(order), len(SLIP))) for k in r}
    for name, value in full.items():
        np.put_along_axis(value, order, r[name], axis=1)
    y, std, cells = channels(full), spreads(full, case), len(SLIP) * (3 if three else 1)

    def least(surface: Surface, rows: slice) -> Floats:
        used = np.zeros_like(full["slip"])
        np.put_along_axis(used, order[:, rows], 1.0, axis=1)
        own = weights(full, std, used, three)[:, :cells]
        return Surface(surface.coefficients[:, :cells]).least(y[:, :cells], own)

    plain = least(w.plain, slice(None))
    parts = w.kind.parts(order.shape[1])
    return plain, plain - np.sum([least(w.knowing, part) for part in parts], axis=0)


def possible(w: World, rows: int, case: Case, three: bool) -> tuple[float, float]:
    """Shares flagged at one per cent by the least misfit, and by who knows the fault."""
    if w.plain is None:
        return 1.0, 1.0
    found = []
    for r, kind, seed in ((w.reads, w.kind, 3), (w.sound, None, 4)):
        order = shuffled(len(r["slip"]), seed)[:, :rows]
        found.append(misfits(w, picked(r, kind, order), order, case, three))
    limits = [np.quantile(sound, 1.0 - FALSE) for sound in found[1]]
    plain, gain = (float(np.mean(v > m)) for v, m in zip(found[0], limits, strict=True))
    return plain, gain


def answers(estimator: Estimator, r: Readings, std: Readings, three: bool) -> Any:
    """Flagged (sets,) and errors in sigma (sets, 3) less the truth: (mean, std, flag) of sets."""
    names = ("slip", "load", "torque") + (("sinkage", "drawbar_pull") if three else ())
    found = []
    for i in range(len(r["slip"])):
        rows = {name: r[name][i] for name in names}
        rows |= {f"{name}_std": std[name][i] for name in names[2:]} | {"torque_bias": 0.0}
        try:
            answer = estimator.run(**rows)
            found.append((answer.mean, answer.std, not bool(answer.in_range)))
        except InputError:
            found.append((np.full(3, np.nan), np.ones(3), True))
    return tuple(np.asarray(part) for part in zip(*found, strict=True))


def cell(w: World, rows: int, case: Case, files: Sequence[Estimator], three: bool) -> Cell:
    """One kind at one size."""
    r = picked(w.reads, w.kind, shuffled(SETS, 3)[:, :rows])
    shares, errors = [], []
    for file in files:
        mean, std, flagged = answers(file, r, spreads(r, case), three)
        shares.append(float(flagged.mean()))
        off = ((mean - w.truth) / std)[~flagged]
        errors.append(np.sqrt(np.mean(off**2, axis=0)) if len(off) else np.full(3, np.nan))
    return Cell((*shares, *possible(w, rows, case, three)), np.stack(errors))


def opened(case: Case, wheel: str, any_wheel: str) -> list[Estimator]:
    """Both files, the second for the wheel of the recipe."""
    gear: Any = case.model.gear
    given = {
        "wheel_radius": gear.radius,
        "wheel_width": gear.width,
        "bearing_modulus": case.soil.kc / gear.width + case.soil.kphi,
        "n": case.soil.n,
        "bearing_std": 0.0,
        "cohesion_max": case.prior["cohesion"].upper,
        "shear_modulus_max": case.prior["shear_modulus"].upper,
    }
    return [Estimator.load(wheel), Estimator.load(any_wheel).on(**given)]


def measured(
    files: Sequence[str], only: Callable[[Kind], bool] = lambda kind: True
) -> dict[tuple[Kind, bool, int], Cell]:
    """All cells, by kind, channels and size."""
    case = read_recipe("wheel").case
    axes = [Coordinate.of(name, case.prior[name]) for name in SHEAR]
    estimators, found = opened(case, *files), {}
    wanted = [Kind("-", "no fault"), *filter(only, kinds(case))]
    with bar("driving", len(wanted)) as done:
        for i, kind in enumerate(wanted):
            w = world(kind, case, axes, 100 + i)
            for three in (False, True):
                for rows in SIZES:
                    if three or not kind.sunk:
                        found[kind, three, rows] = cell(w, rows, case, estimators, three)
            done(i + 1)
    return found


def false_flags(files: Sequence[str] = RELEASED) -> str:
    """Share flagged of sets without a fault, driven in all the ways that sets are driven in."""
    recipe = read_recipe("wheel")
    estimators, shares = opened(recipe.case, *files), []
    for rows in SIZES:
        sets = RecipeFamily.of(recipe, SHEAR).sets(MANY, rows, 4711)
        std = {name: sets.readings[f"{name}_std"] for name in KEYS}
        read = {k: np.where(v < ABSENT, sets.readings[k], np.nan) for k, v in std.items()}
        given = {k: sets.readings[k] for k in ("slip", "load")} | read
        shares.append([answers(file, given, std, True)[2].mean() for file in estimators])
    cells = [" / ".join(f"{100 * share:.1f}" for share in found) for found in shares]
    return "\n".join([heading("no fault", SIZES), f"| {MANY} sets each | {' | '.join(cells)} |"])


def table(files: Sequence[str] = RELEASED) -> str:
    """Markdown of all kinds."""
    found = measured(files)
    return "\n\n".join(
        [ABOUT, short(found), FALSELY, false_flags(files), CELLS, written(found, SIZES)]
    )


if __name__ == "__main__":
    print(table(sys.argv[1:] or RELEASED))
