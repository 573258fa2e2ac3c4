"""The forward model beside other ways to the same solutions, in one run and one process.

python bench/run.py peers
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import peers_c
import peers_counts
import peers_figure
import peers_scipy
import plain_numpy
from reference import equilibrium

from soilml import Model, Operating, Wheel, soil
from soilml.physics.gears import wheel

Floats = np.ndarray[Any, np.dtype[np.float64]]
Rows = Mapping[str, Floats | float]

#: Sizes of a call, and the row-by-row and plain ways up to which size.
SIZES = (1, 10, 100, 1000, 10_000, 100_000, 1_000_000)
#: Rows of the comparison, and those whose errors are measured.
ROWS, CHECKED = 100_000, 40
#: Effort of each way: points in each part of the contact, points along it, tolerances.
POINTS = (4, 6, 8, 10, 12, 13, 16, 20)
PLAIN_POINTS = (26, 51, 101, 201, 401, 801)
TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9)
#: Processor time spent on each figure, s, and the most repetitions.
SPENT, MOST_REPEATS = 0.6, 50
ABOUT = (
    "![Time of a solution by size of a call and by error](docs/speed.png)\n\n"
    "Driving wheels, r 0.15 m and b 0.12 m, on soils of the recipe `wheel`; torque at a given load "
    "and slip. Processor time of one core, the fastest of several calls, all ways in one process. "
    f"*Error*: largest relative error of the torque of {CHECKED} rows against adaptive quadrature "
    "with eleven digits (`tests/reference.py`). C is `bench/peers_wheel.c`, the same equations and "
    "points in double precision, compiled by gcc with -march=native. It serves this comparison "
    "only: the package has its physics once, in numpy "
    "([decision 32](docs/decisions/0032-forward-solve.md))."
)


@dataclass(frozen=True)
class Way:
    """A way to torques (batch,): its name, function of rows and effort, efforts, most rows."""

    name: str
    torque: Callable[[Rows, Any], Floats]
    efforts: tuple[float, ...]
    usual: float
    most: int


@dataclass(frozen=True)
class Cost:
    """Processor time of a row, s, and the largest relative error."""

    seconds: float
    error: float


def tables(folder: Path) -> str:
    """All tables, and the picture."""
    ways, truth = _ways(folder), _truth()
    by_size = {way.name: _by_size(way) for way in ways}
    by_error = {way.name: [_cost(way, effort, truth) for effort in way.efforts] for way in ways}
    peers_figure.draw(by_size, {k: [(c.error, c.seconds) for c in v] for k, v in by_error.items()})
    usual = {w.name: by_error[w.name][w.efforts.index(w.usual)] for w in ways}
    parts = [_side_by_side(usual), _floor(usual["soilml"].seconds), _sizes(by_size)]
    parts.append(_efforts(ways, by_error))
    if len(ways) < 5:
        parts.append("There is no gcc on this machine, so that C was not measured.")
    return "\n\n".join(parts)


def _ways(folder: Path) -> list[Way]:
    ways = [
        Way("scipy, quad and brentq row by row", _scipy, TOLERANCES, 1e-7, 10),
        Way("numpy, trapezoid and bisection", _plain, PLAIN_POINTS, 201, 1000),
        Way("soilml", _soilml, POINTS, wheel.DRIVING_NODES, SIZES[-1]),
    ]
    for name, flags in (("C, -O3", peers_c.STRICT), ("C, -O3 -ffast-math", peers_c.FAST)):
        solve = peers_c.compiled(folder, flags)
        if solve is not None:
            ways.append(Way(name, solve, POINTS, wheel.DRIVING_NODES, SIZES[-1]))
    return ways


def rows_of(count: int) -> dict[str, Floats | float]:
    """Columns of driving wheels (count,), or numbers; the first ones of every count are alike."""
    draws = np.random.default_rng(0).random((count, 5)).T
    ranges = {
        "cohesion": (0.0, 3000.0),
        "friction_angle": (0.44, 0.79),
        "shear_modulus": (0.005, 0.03),
        "slip": (0.05, 0.6),
        "load": (30.0, 120.0),
    }
    sand = vars(soil("wong1989/dry_sand"))
    rows = {name: float(sand[name]) for name in ("n", "kc", "kphi", "a0", "a1")}
    for (name, (low, high)), u in zip(ranges.items(), draws, strict=True):
        rows[name] = low + (high - low) * u
    return rows | {"radius": 0.15, "width": 0.12}


def _soilml(rows: Rows, points: int) -> Floats:
    with patch.object(wheel, "DRIVING_NODES", points):
        return model_torque(rows)


def model_torque(rows: Rows) -> Floats:
    """The package's torque (N m) of rows."""
    names = ("cohesion", "friction_angle", "shear_modulus", "n", "kc", "kphi", "a0", "a1")
    ground = soil("wong1989/dry_sand", **{name: rows[name] for name in names})
    gear = Wheel(radius=rows["radius"], width=rows["width"])
    torque: Floats = Model(gear)(ground, Operating(slip=rows["slip"], load=rows["load"])).torque
    return torque


def _plain(rows: Rows, points: int) -> Floats:
    with patch.object(plain_numpy, "POINTS", points):
        return plain_numpy.torque(rows)


def _scipy(rows: Rows, tolerance: float) -> Floats:
    count = np.size(rows["load"])
    columns = {name: np.broadcast_to(value, count) for name, value in rows.items()}
    each = ({name: float(v[i]) for name, v in columns.items()} for i in range(count))
    return np.asarray([peers_scipy.torque(row, tolerance) for row in each])


def _truth() -> Floats:
    columns = {n: np.broadcast_to(v, CHECKED) for n, v in rows_of(CHECKED).items()}
    each = ({n: float(v[i]) for n, v in columns.items()} for i in range(CHECKED))
    return np.asarray([equilibrium(row)[2] for row in each])


def _cost(way: Way, effort: float, truth: Floats) -> Cost:
    print(f"  {way.name}, {effort:g}", file=sys.stderr)
    error = np.max(np.abs(way.torque(rows_of(CHECKED), effort) / truth - 1.0))
    return Cost(_seconds(way, effort, min(ROWS, way.most)), float(error))


def _by_size(way: Way) -> list[tuple[int, float]]:
    print(f"  {way.name} by size", file=sys.stderr)
    sizes = [size for size in SIZES if size <= way.most]
    return [(size, _seconds(way, way.usual, size)) for size in sizes]


def _seconds(way: Way, effort: float, count: int) -> float:
    """Processor time of a row in calls of this many."""
    rows = rows_of(count)
    times: list[float] = []
    way.torque(rows_of(min(count, 1000)), effort)
    while not times or (sum(times) < SPENT and len(times) < MOST_REPEATS):
        started, calls = time.process_time(), 0
        while calls == 0 or time.process_time() - started < SPENT / 20:
            way.torque(rows, effort)
            calls += 1
        times.append((time.process_time() - started) / calls)
    return min(times) / count


def _side_by_side(usual: dict[str, Cost]) -> str:
    ours = usual["soilml"].seconds
    lines = ["| way | solutions per second | time over soilml's | error |", "|---|" + "---:|" * 3]
    for name, cost in usual.items():
        ratio = cost.seconds / ours
        cells = f"{1.0 / cost.seconds:,.0f} | {ratio:,.3g} | {cost.error:.1e}"
        lines.append(f"| {name} | {cells} |")
    return "\n".join(lines)


def _floor(ours: float) -> str:
    """What the transcendental functions that the model calls would take alone."""
    counted = peers_counts.calls_of(model_torque, _counted_columns())
    lines = [
        "| function | calls for a solution | ns for a call | us for a solution |",
        "|---|" + "---:|" * 3,
    ]
    total = 0.0
    for call, count in sorted(counted.items(), key=lambda item: -item[1]):
        each, seconds = count / CHECKED_FOR_COUNTS, peers_counts.seconds_of(call)
        total += each * seconds
        cells = f"{each:.1f} | {1e9 * seconds:.2f} | {1e6 * each * seconds:.3f}"
        lines.append(f"| {call[0]}, {call[1]} | {cells} |")
    lines.append(f"| all: the floor | | | {1e6 * total:.3f} |")
    return (
        "The floor: transcendental functions that numpy is called with while soilml solves "
        f"{CHECKED_FOR_COUNTS:,} rows, times the processor time of a number in each, in arrays "
        "that stay in the cache. Sines and cosines at the points are products of matrices, and "
        "not among them.\n\n" + "\n".join(lines) + f"\n\nA solution takes {1e6 * ours:.3g} us, "
        f"{ours / total:.2g} times the floor."
    )


#: A chunk of the model.
CHECKED_FOR_COUNTS = 2048


def _counted_columns() -> dict[str, Any]:
    return {n: np.asarray(v) for n, v in rows_of(CHECKED_FOR_COUNTS).items()}


def _sizes(by_size: dict[str, list[tuple[int, float]]]) -> str:
    names = list(by_size)
    lines = [
        "| rows in a call: us for a row | " + " | ".join(names) + " |",
        "|---|" + "---:|" * len(names),
    ]
    for size in SIZES:
        times = [dict(found).get(size) for found in by_size.values()]
        cells = ["" if t is None else f"{1e6 * t:,.3g}" for t in times]
        lines.append(f"| {size:,} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _efforts(ways: list[Way], by_error: dict[str, list[Cost]]) -> str:
    lines = ["| way | effort | error | us for a row |", "|---|---|---:|---:|"]
    for way in ways:
        word = "tolerance" if way.torque is _scipy else "points"
        word += "" if way.torque in (_scipy, _plain) else " in each of two parts"
        for effort, cost in zip(way.efforts, by_error[way.name], strict=True):
            mark = ", as used above" if effort == way.usual else ""
            cells = f"{effort:g} {word}{mark} | {cost.error:.1e} | {1e6 * cost.seconds:,.3g}"
            lines.append(f"| {way.name} | {cells} |")
    return "\n".join(lines)
