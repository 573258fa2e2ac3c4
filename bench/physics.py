"""The forward model: accuracy against adaptive quadrature, and throughput."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from conftest import input_box, solved
from reference import equilibrium

from soilml import ExitAngle, LinearWheel, Model, Operating, SlipSinkage, Soil, Wheel, soil

SPEED_ROWS = 200_000
BOX_ROWS = 16_384
ACCURACY_ROWS = 1024
BASELINE_ROWS = 40
REPEATS = 3


def accuracy() -> str:
    """Largest and median relative error over the input box."""
    lines = [
        "| slip | rows | entry angle, maximum | torque, maximum | drawbar pull / load, maximum "
        "| torque, median |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for label, sign in (("driving, 0 to 0.95", 1), ("braking, -0.9 to 0", -1)):
        box = input_box(ACCURACY_ROWS, seed=123)
        box["slip"] = sign * np.abs(box["slip"])
        force = solved(box)
        errors = []
        for i in np.flatnonzero(force.status == 0)[::3]:
            row = {name: values[i] for name, values in box.items()}
            entry, pull, torque = equilibrium(row, near=force.entry_angle[i])
            errors.append(
                (
                    abs(force.entry_angle[i] / entry - 1.0),
                    abs(force.torque[i] / torque - 1.0),
                    abs(force.drawbar_pull[i] - pull) / row["load"],
                )
            )
        worst, middle = np.max(errors, axis=0), np.median(errors, axis=0)
        lines.append(
            f"| {label} | {len(errors)} | {worst[0]:.1e} | {worst[1]:.1e} | {worst[2]:.1e} "
            f"| {middle[1]:.1e} |"
        )
    return "\n".join(lines)


def speed() -> str:
    """Solutions per second, beside scalar quadrature."""
    rng = np.random.default_rng(0)
    sand = soil(
        "wong1989/dry_sand",
        cohesion=rng.uniform(0.0, 3000.0, SPEED_ROWS),
        friction_angle=rng.uniform(0.44, 0.79, SPEED_ROWS),
        shear_modulus=rng.uniform(0.005, 0.03, SPEED_ROWS),
    )
    load = rng.uniform(30.0, 120.0, SPEED_ROWS)
    slip = rng.uniform(0.05, 0.6, SPEED_ROWS)
    wheel = Model(Wheel(radius=0.15, width=0.12))
    effects = wheel + SlipSinkage(n1=0.4) + ExitAngle(kappa=0.1)
    box = input_box(BOX_ROWS, seed=123)
    box["slip"] = np.abs(box["slip"])
    first = slice(BASELINE_ROWS)
    columns = vars(rows_of(sand, first)) | {"radius": 0.15, "width": 0.12}
    columns |= {"slip": slip[first], "load": load[first]}

    def in_calls() -> None:
        for start in range(0, SPEED_ROWS // 4, 1000):
            part = slice(start, start + 1000)
            wheel(rows_of(sand, part), Operating(slip=slip[part], load=load[part]))

    def row_by_row() -> None:
        for i in range(BASELINE_ROWS):
            row = {name: np.take(value, i) for name, value in columns.items() if np.ndim(value)}
            equilibrium(columns | {name: float(value) for name, value in row.items()})

    cases: dict[str, tuple[Callable[[], object], int]] = {
        "adaptive quadrature and bracketing, row by row (scipy)": (row_by_row, BASELINE_ROWS),
        "rigid wheel, driving": (
            lambda: wheel(sand, Operating(slip=slip, load=load)),
            SPEED_ROWS,
        ),
        "the same, in calls of 1000 rows": (in_calls, SPEED_ROWS // 4),
        "the same, over the whole input box of the accuracy table, with rows that are too heavy": (
            lambda: solved(box),
            BOX_ROWS,
        ),
        "rigid wheel, driving, two effects": (
            lambda: effects(sand, Operating(slip=slip, load=load)),
            SPEED_ROWS,
        ),
        "rigid wheel, braking": (
            lambda: wheel(sand, Operating(slip=-slip, load=load)),
            SPEED_ROWS,
        ),
        "linear-stress wheel (closed form)": (
            lambda: Model(LinearWheel(radius=0.15, width=0.12))(
                sand, Operating(slip=slip, load=load)
            ),
            SPEED_ROWS,
        ),
    }
    best = dict.fromkeys(cases, np.inf)
    for _ in range(REPEATS):  # in turn, so that all see the same machine
        for label, (call, _) in cases.items():
            started = time.perf_counter()
            call()
            best[label] = min(best[label], time.perf_counter() - started)
    rates = {label: count / best[label] for label, (_, count) in cases.items()}
    scalar = next(iter(rates.values()))
    return "\n".join(
        [
            "| case | solutions per second, one core | ratio to the scalar loop |",
            "|---|---:|---:|",
            *(f"| {label} | {rate:,.0f} | {rate / scalar:,.0f} |" for label, rate in rates.items()),
        ]
    )


def rows_of(ground: Soil, part: slice) -> Soil:
    """Some rows of a soil whose parameters are arrays or numbers."""
    return replace(
        ground, **{k: v[part] for k, v in vars(ground).items() if np.ndim(v) and len(v) > 1}
    )
