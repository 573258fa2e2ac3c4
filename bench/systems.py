"""Other gears and the systems of the source papers: speed, accuracy, and coverage of bands."""

from __future__ import annotations

import math
import time

import numpy as np
from climbing_coverage import simulate_coverage
from numpy.typing import NDArray

from soilml import Midstance, Model, Operating, Wheel, soil
from soilml.io.text_tables import format_table
from soilml.systems.tracked_robot.robot import WANG2018
from soilml.systems.wheel_legs.geometry import wheel_leg
from soilml.systems.wheel_legs.integrator import explicit_step
from soilml.systems.wheel_legs.resistive_force import LinearGround
from soilml.systems.wheel_legs.walk import walk

ROWS = 50_000
#: Steps per turn of the paper (1e-4 s at 0.3 rad/s), and a vanishing speed of regularisation.
FINE, SHARP = round(2.0 * math.pi / 0.3 / 1e-4), 1e-9
#: Seeds of rovers that were not used to tune the method.
SEEDS = range(1000, 1060)
LINES = (
    ("0, 4", ("cohesion", "friction_angle"), True),
    ("0, 4, 8", ("cohesion", "friction_angle"), False),
    ("0, 4, 8, 10", ("cohesion",), True),
    ("0, 4, 8, 10", (), False),
)
SYMBOLS = {"cohesion": "c", "friction_angle": "phi", "shear_modulus": "k_x"}


def gears() -> str:
    """Solutions per second of every gear."""
    rng = np.random.default_rng(0)
    slip = rng.uniform(0.0, 0.6, ROWS)
    sand = soil("wong1989/dry_sand", friction_angle=rng.uniform(0.44, 0.79, ROWS))
    foot = Midstance.of_foot(length=0.04, height=0.0055, width=0.029, leg_length=0.18)
    cases = {
        "rigid wheel": (Wheel(radius=0.15, width=0.12), rng.uniform(30.0, 120.0, ROWS)),
        "foot of a wheel-leg": (foot, rng.uniform(4.0, 12.0, ROWS)),
        "flexible track": (WANG2018.track, rng.uniform(400.0, 800.0, ROWS)),
    }
    lines = [
        "| gear | solutions per second, one core | ratio to the rigid wheel |",
        "|---|---:|---:|",
    ]
    first = 0.0
    for name, (gear, load) in cases.items():
        started = time.perf_counter()
        force = Model(gear)(sand, Operating(slip=slip, load=load))
        rate = float(np.count_nonzero(force.status == 0)) / (time.perf_counter() - started)
        first = first or rate
        lines.append(f"| {name} | {rate:,.0f} | {rate / first:.2f} |")
    return "\n".join(lines)


def walking() -> str:
    """Seconds per turn, and the difference from the paper's step of 1e-4 s."""
    ground = LinearGround(stiffness=0.7e6)
    cases = [wheel_leg(foot) for foot in ("none", "LTF", "SRF", "CIF")]
    cases += [wheel_leg("none", legs=legs) for legs in (2, 3, 6)]
    lines = [
        "| steps per turn | cases | seconds | hub height, rms difference | largest sinkage, "
        "difference | rms slip, difference |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    started = time.perf_counter()
    fine = walk(cases, ground, turns=1.0, steps=FINE, step=explicit_step, fading=SHARP)
    spent = time.perf_counter() - started
    lines.append(f"| {FINE} (1e-4 s, explicit) | {len(cases)} | {spent:.0f} | | | |")
    for steps in (500, 1000, 2000):
        started = time.perf_counter()
        coarse = walk(cases, ground, turns=1.0, steps=steps)
        spent = time.perf_counter() - started
        near = fine.z[np.searchsorted(fine.angle, coarse.angle[coarse.angle <= fine.angle[-1]])]
        off = 1e3 * np.sqrt(np.mean((coarse.z[: len(near)] - near) ** 2, axis=0)).max()
        deep = 1e3 * np.abs(coarse.sinkage.max(axis=0) - fine.sinkage.max(axis=0)).max()
        slip = np.abs(_rms(coarse.slip) - _rms(fine.slip)).max()
        lines.append(
            f"| {steps} | {len(cases)} | {spent:.2f} | {off:.1f} mm | {deep:.1f} mm | {slip:.3f} |"
        )
    for count in (1, 24):
        started = time.perf_counter()
        walk(cases[1], [ground] * count, turns=1.0)
        lines.append(f"| 1000 | {count} | {time.perf_counter() - started:.2f} | | | |")
    return "\n".join(lines)


def _rms(slip: NDArray[np.float64]) -> NDArray[np.float64]:
    """Root mean square over a turn, for each case."""
    return np.asarray(np.sqrt(np.mean(slip**2, axis=0)))


def climbing() -> str:
    """Coverage of 90 % bands over rovers, and rms of error over reported standard deviation."""
    header = (
        "slopes, deg",
        "estimated",
        "loads",
        "phi",
        "k_x",
        "pull",
        "steepest",
        "steepest, rms error, deg",
    )
    table = []
    for slopes, given, known in LINES:
        angles = np.deg2rad([float(s) for s in slopes.split(",")])
        found = simulate_coverage(SEEDS, angles.tolist(), fixed=given, known_loads=known)
        cells = [
            f"{100 * found[n].inside:.0f} %, {found[n].score:.2f}" if n in found else ""
            for n in ("friction_angle", "shear_modulus", "pull", "steepest")
        ]
        rms = math.degrees(float(np.sqrt(np.mean(found["steepest"].error ** 2))))
        what = ", ".join(short for name, short in SYMBOLS.items() if name not in given)
        table.append((slopes, what, "known" if known else "estimated", *cells, f"{rms:.2f}"))
    return f"```\n{format_table(header, table, text_columns=3)}\n```"


if __name__ == "__main__":
    print(gears(), walking(), climbing(), sep="\n\n")
