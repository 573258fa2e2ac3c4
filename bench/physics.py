"""The forward model: accuracy against adaptive quadrature, and throughput."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from conftest import input_box, solved
from reference import equilibrium

from soilml import ExitAngle, LinearWheel, Model, Operating, SlipSinkage, Wheel, soil

SPEED_ROWS = 200_000
ACCURACY_ROWS = 1024
BASELINE_ROWS = 40


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
    """Solutions per second, and the ratio to a loop of scalar quadrature and bracketing."""
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
    cases = {
        "rigid wheel, driving": (wheel, slip),
        "rigid wheel, driving, two effects": (
            wheel + SlipSinkage(n1=0.4) + ExitAngle(kappa=0.1),
            slip,
        ),
        "rigid wheel, braking": (wheel, -slip),
        "linear-stress wheel (closed form)": (Model(LinearWheel(radius=0.15, width=0.12)), slip),
    }
    names = ("cohesion", "friction_angle", "shear_modulus")
    started = time.perf_counter()
    for i in range(BASELINE_ROWS):
        row = {n: float(getattr(sand, n)[i]) for n in names}
        row |= {n: getattr(sand, n) for n in ("kc", "kphi", "n", "a0", "a1")}
        row |= {"radius": 0.15, "width": 0.12, "slip": slip[i], "load": load[i]}
        equilibrium(row)
    baseline = BASELINE_ROWS / (time.perf_counter() - started)
    lines = [
        "| case | solutions per second, one core | ratio to the scalar loop |",
        "|---|---:|---:|",
        f"| adaptive quadrature and bracketing, row by row | {baseline:.1f} | 1 |",
    ]
    for label, (model, slips) in cases.items():
        best = np.inf
        for _ in range(3):
            started = time.perf_counter()
            model(sand, Operating(slip=slips, load=load))
            best = min(best, time.perf_counter() - started)
        rate = SPEED_ROWS / best
        lines.append(f"| {label} | {rate:,.0f} | {rate / baseline:,.0f} |")
    return "\n".join(lines)
