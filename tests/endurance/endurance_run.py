"""A day at 10 Hz through `Estimator.step`, as fast as it goes: `make endurance`.

A rover drives over soils that change, each with a memory of its own. Sensors are stuck, deliver
bursts of values that are not finite, or give impossible readings, and the rover pauses, which
gives readings outside of the file's range. After each reading that is refused the caller goes on
with the memory that it had.
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
from array import array
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from soilml import Model, Operating, Soil, Wheel, soil  # noqa: E402
from soilml.errors import InputError  # noqa: E402
from soilml.onboard import Estimate, Estimator, Memory  # noqa: E402

Floats = np.ndarray[Any, np.dtype[np.float64]]

RATE_HZ = 10
#: Readings of one soil: 20 minutes.
STEPS_PER_SOIL = 12_000
#: Ends of slip and load (N), and of the soils (Pa, rad, m), inside of the prior of the file.
SLIP, LOAD = (0.08, 0.55), (40.0, 110.0)
SOILS = np.asarray([[100.0, 2900.0], [0.45, 0.77], [0.006, 0.029]])
TORQUE_NOISE = 0.02
#: Readings of one disturbance, and every how many readings one begins.
DISTURBED, PERIOD = 50, 1000
DISTURBANCES = ("stuck", "not finite", "impossible", "pause")
NOT_FINITE = (np.nan, np.inf, -np.inf)


@dataclass
class Result:
    """What a day showed.

    Parameters
    ----------
    seconds : array of float
        Time of each step that was read.
    counts : Counter
        Readings by what they were, and ``refused``.
    bytes_of_memory : list of int
        Size of `Memory.system` and `Memory.counts` after each soil.
    resident : list of int
        Resident memory of the process after each soil, without the times in `seconds`, bytes.
    errors, drifts : list of ndarray
        After each soil, in standard deviations: distance of the estimate from the truth, and from
        the estimate of the same readings in one call, (3,).
    flagged : int
        Soils whose last estimate is out of range.
    """

    seconds: array[float] = field(default_factory=lambda: array("d"))
    counts: Counter[str] = field(default_factory=Counter)
    bytes_of_memory: list[int] = field(default_factory=list)
    resident: list[int] = field(default_factory=list)
    errors: list[Floats] = field(default_factory=list)
    drifts: list[Floats] = field(default_factory=list)
    flagged: int = 0


def resident_bytes() -> int:
    """Resident memory of this process, bytes."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096


def readings(rng: np.random.Generator, truth: Floats, count: int) -> dict[str, Floats]:
    """Slip, load (N) and torque (N m) with noise, (count,), of a soil (3,)."""
    slip, load = (low + (high - low) * rng.random(count) for low, high in (SLIP, LOAD))
    sand = soil("wong1989/dry_sand")
    names = ("cohesion", "friction_angle", "shear_modulus")
    of_truth = dict(zip(names, map(float, truth), strict=True))
    known = {name: getattr(sand, name) for name in ("kc", "kphi", "n", "a0", "a1", "unit_weight")}
    force = Model(Wheel(radius=0.15, width=0.12))(
        Soil(**known, **of_truth), Operating(slip=slip, load=load)
    )
    return {
        "slip": slip,
        "load": load,
        "torque": force.torque * (1.0 + TORQUE_NOISE * rng.standard_normal(count)),
    }


def disturb(rows: dict[str, Floats], rng: np.random.Generator) -> list[str]:
    """Change rows in place: a disturbance every `PERIOD` rows; what each row is."""
    count = len(rows["slip"])
    kinds = ["sound"] * count
    for number, begin in enumerate(range(PERIOD // 2, count - DISTURBED, PERIOD)):
        kind = DISTURBANCES[number % len(DISTURBANCES)]
        here = slice(begin, begin + DISTURBED)
        if kind == "stuck":
            for values in rows.values():  # a bus that repeats its last message
                values[here] = values[begin - 1]
        elif kind == "not finite":
            rows["torque"][here] = rng.choice(NOT_FINITE, DISTURBED)
        elif kind == "impossible":
            rows["load"][here] = -rows["load"][here]
        else:
            rows["slip"][here], rows["torque"][here] = 0.0, 0.0
        kinds[here] = [kind] * DISTURBED
    return kinds


def drive(
    estimator: Estimator, rows: dict[str, Floats], result: Result
) -> tuple[Estimate, Memory, list[int]]:
    """Step through rows of one soil: last estimate, memory, and which rows were read."""
    memory, read = estimator.start(), []
    estimate = estimator.prior_estimate()
    for i, (slip, load, torque) in enumerate(
        zip(*(rows[name].tolist() for name in ("slip", "load", "torque")), strict=True)
    ):
        begun = time.perf_counter()
        try:
            estimate, memory = estimator.step(memory, slip=slip, load=load, torque=torque)
        except InputError:
            result.counts["refused"] += 1
            continue
        result.seconds.append(time.perf_counter() - begun)
        read.append(i)
        if not np.isfinite(estimate.mean).all():
            raise RuntimeError(f"an estimate that is not finite after slip {slip}, load {load}")
    return estimate, memory, read


def run_day(steps: int, per_soil: int, seed: int, show: bool = False) -> Result:
    """Drive `steps` readings over soils of `per_soil` readings each, with the released file."""
    # errors of the model are linearised at the soil that is known when a row arrives
    estimator = Estimator.load(ROOT / "exported" / "wheel.onnx").on(model_error=0.0)
    rng, result, done = np.random.default_rng(seed), Result(), 0
    while done < steps:
        count = min(per_soil, steps - done)
        truth = SOILS[:, 0] + (SOILS[:, 1] - SOILS[:, 0]) * rng.random(3)
        rows = readings(rng, truth, count)
        result.counts.update(disturb(rows, rng))
        estimate, memory, read = drive(estimator, rows, result)
        at_once = {name: values[read] for name, values in rows.items()}
        whole, _ = estimator.step(estimator.start(), **at_once)
        result.errors.append(np.abs(estimate.mean - truth) / estimate.std)
        result.drifts.append(np.abs(estimate.mean - whole.mean) / whole.std)
        result.flagged += not bool(estimate.in_range)
        result.bytes_of_memory.append(memory.system.nbytes + memory.counts.nbytes)
        gc.collect()
        result.resident.append(resident_bytes() - 8 * len(result.seconds))
        done += count
        if show:
            print(summary(result, done), flush=True)
    return result


def summary(result: Result, done: int) -> str:
    """One line: what was measured so far."""
    p50, p99, worst = 1e3 * np.quantile(result.seconds, [0.5, 0.99, 1.0])
    return (
        f"{done / RATE_HZ / 3600:5.2f} h {done:7} readings, {result.counts['refused']} refused, "
        f"{len(result.errors)} soils, {result.flagged} flagged | latency p50 {p50:.2f} p99 "
        f"{p99:.2f} max {worst:.1f} ms | memory {set(result.bytes_of_memory)} bytes | resident "
        f"{result.resident[0] / 1e6:.1f} -> {result.resident[-1] / 1e6:.1f} MB | errors above 3 "
        f"std: {np.sum(np.asarray(result.errors) > 3.0)} of {3 * len(result.errors)} | drift at "
        f"most {np.max(result.drifts):.1e} std"
    )


def main() -> None:
    """Print a line after each soil."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=24 * 3600 * RATE_HZ)
    parser.add_argument("--per-soil", type=int, default=STEPS_PER_SOIL)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    run_day(args.steps, args.per_soil, args.seed, show=True)


if __name__ == "__main__":
    main()
