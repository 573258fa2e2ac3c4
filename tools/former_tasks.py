"""Seconds of a few tasks by the version of soilml whose root is the working folder, as JSON.

Run by `former.py` in a process of its own for each version; only names that all versions have are
used. Tasks are repeated after a first call that does not count; the fastest counts, and on board
the median.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from soilml import (
    Bulldozing,
    Estimator,
    Model,
    Operating,
    SlipSinkage,
    Wheel,
    identify,
    read_case,
    read_table,
    soil,
)
from soilml.gap import gap

ROWS, PART, READINGS = 50_000, 1000, 64
WHEEL = Wheel(radius=0.15, width=0.12)
MODEL = """[gear]
type = "wheel"
radius = 0.15
width = 0.12

[soil]
name = "wong1989/dry_sand"

[soil.prior]
cohesion = [0.0, 3000.0]
friction_angle = [0.44, 0.79]
shear_modulus = [0.005, 0.03]

[noise]
torque_Nm = "2 %"
sinkage_m = 0.0005
"""


def seconds() -> dict[str, float]:
    """Seconds of each task; those of forward solutions are per solution."""
    rng = np.random.default_rng(0)
    sand = soil(
        "wong1989/dry_sand",
        cohesion=rng.uniform(0.0, 3000.0, ROWS),
        friction_angle=rng.uniform(0.44, 0.79, ROWS),
        shear_modulus=rng.uniform(0.005, 0.03, ROWS),
    )
    slip, load = rng.uniform(0.05, 0.6, ROWS), rng.uniform(30.0, 120.0, ROWS)
    driving, braking = Operating(slip=slip, load=load), Operating(slip=-slip, load=load)
    parts = [
        Operating(slip=slip[i : i + PART], load=load[i : i + PART]) for i in range(0, ROWS, PART)
    ]
    plain, dry = Model(WHEEL), soil("wong1989/dry_sand")
    bent = plain + SlipSinkage(n1=0.3) + Bulldozing(share=0.5)
    taken = {
        "in calls of 1000": _fastest(lambda: [plain(dry, at) for at in parts], 3) / ROWS,
        "driving": _fastest(lambda: plain(sand, driving), 3) / ROWS,
        "two effects": _fastest(lambda: bent(sand, driving), 3) / ROWS,
        "braking": _fastest(lambda: plain(sand, braking), 3) / ROWS,
    }
    with tempfile.TemporaryDirectory() as folder:
        taken |= _of_readings(Path(folder))
    return taken | _on_board()


def _of_readings(folder: Path) -> dict[str, float]:
    """Identification and the gap workflow on torque and sinkage at four loads."""
    (folder / "model.toml").write_text(MODEL)
    case = read_case(folder / "model.toml")
    rng = np.random.default_rng(1)
    slip, load = rng.uniform(0.05, 0.6, READINGS), np.repeat([35.0, 60.0, 85.0, 110.0], 16)
    true = soil("wong1989/dry_sand", cohesion=900.0, friction_angle=0.6, shear_modulus=0.012)
    hidden = Model(WHEEL) + SlipSinkage(n1=0.3)
    tables = []
    for model in (Model(WHEEL), hidden):
        force = model(true, Operating(slip=slip, load=load))
        torque = force.torque * (1.0 + 0.02 * rng.standard_normal(READINGS))
        sinkage = force.sinkage + 0.0005 * rng.standard_normal(READINGS)
        rows = zip(load, slip, load, torque, sinkage, strict=True)
        lines = ["run,slip,load_N,torque_Nm,sinkage_m"]
        lines += [f"{run:g},{s},{w},{t},{z}" for run, s, w, t, z in rows]
        (folder / "runs.csv").write_text("\n".join(lines))
        tables.append(read_table(folder / "runs.csv"))
    known, gapped = tables
    return {
        "nonlinear": _fastest(lambda: identify(case, known, method="nonlinear"), 5),
        "posterior": _fastest(lambda: identify(case, known, method="posterior"), 2),
        "no gap": _fastest(lambda: gap(case, known), 2),
        "gap": _fastest(lambda: gap(case, gapped), 2),
    }


def _on_board() -> dict[str, float]:
    """One reading and a set of 16, with the version's own released file; medians."""
    estimator = Estimator.load(Path("exported") / "wheel.onnx")
    slip, load = np.linspace(0.08, 0.55, 16), np.tile([40.0, 75.0, 110.0, 90.0], 4)
    torque = Model(WHEEL)(soil("wong1989/dry_sand"), Operating(slip=slip, load=load)).torque
    one = {"slip": 0.3, "torque": 3.0, "load": 60.0}
    return {
        "one reading": _median(lambda: estimator(**one)),
        "set": _median(lambda: estimator.run(slip=slip, torque=torque, load=load)),
    }


def _times(call: Callable[[], object], repeats: int) -> list[float]:
    call()
    times = []
    for _ in range(repeats):
        started = time.process_time()
        call()
        times.append(time.process_time() - started)
    return times


def _fastest(call: Callable[[], object], repeats: int) -> float:
    return min(_times(call, repeats))


def _median(call: Callable[[], object], repeats: int = 1000) -> float:
    return float(np.median(_times(call, repeats)))


if __name__ == "__main__":
    print(json.dumps(seconds()))
