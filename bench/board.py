"""On board: latency of an estimate, time from import to the first estimate, memory."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from datagen.recipe import read_recipe
from soilml import Estimator, Model, Operating, Wheel, soil
from soilml.identification.trained_estimator import for_simulated_case
from soilml.onboard.memory import Memory
from soilml.onboard.set_contract import MEMORY_OUTPUTS, SET_OUTPUTS, SET_PREFIX

ROOT = Path(__file__).parents[1]
CALLS = 4000
#: Readings before a step that is timed.
STEPS = (8, 24, 200, 2000)
OUTPUTS = ("mean", "std", "covariance", "in_range")
COLD = """
import time; t = time.perf_counter()
from soilml.onboard.estimator import Estimator
e = Estimator.load({path!r}); e(slip=0.3, torque=3.0, load=60.0)
t = time.perf_counter() - t
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(t, int(status["VmRSS"].split()[0]) / 1024)
"""


def section(folder: Path) -> str:
    """All tables of the latency on board."""
    return "\n\n".join([latency(), steps(), cold_start()])


def latency() -> str:
    """Median and 99th percentile (us): onnxruntime, and through `Estimator`; sets of 16."""
    lines = [
        "| file | kB | 1 reading, onnxruntime | p99 | 1 reading, `Estimator` | p99 "
        "| 16 readings, onnxruntime | 16 readings, `run` | 1 more reading, `step` |",
        "|---|---:|" + "---:|" * 7,
    ]
    case = read_recipe("wheel").case
    for file in sorted((ROOT / "exported").glob("*wheel*.onnx")):
        estimator = for_simulated_case(Estimator.load(file), case)
        size = f"| {file.name} | {file.stat().st_size / 1e3:.0f} "
        alone = estimator.sets is not None and estimator.sets.sets_only
        whole = timed(lambda e=estimator: e(**reading()))
        if alone:
            lines.append(f"{size}| | | {whole[0]:.0f} | {whole[1]:.0f} {_set_latency(estimator)}")
            continue
        feed = {n: np.asarray([v], np.float32) for n, v in reading().items()}
        raw = timed(lambda e=estimator, f=feed: e.session.run(OUTPUTS, f))
        lines.append(
            f"{size}| {raw[0]:.0f} | {raw[1]:.0f} | {whole[0]:.0f} | {whole[1]:.0f} "
            f"{_set_latency(estimator)}"
        )
    return "\n".join(lines)


def _set_latency(estimator: Estimator) -> str:
    """Cells for 16 readings: onnxruntime, `run`, and one more reading by `step`."""
    many = readings()
    run = timed(lambda: estimator.run(**many), CALLS // 8)
    if estimator.sets is None:
        return f"| | {run[0]:.0f} | |"
    raw = set_in_runtime(estimator)
    _, memory = estimator.step(estimator.start(), **many)
    step = timed(lambda: estimator.step(memory, **reading()), CALLS // 8)
    return f"| {raw[0]:.0f} | {run[0]:.0f} | {step[0]:.0f} |"


def set_in_runtime(estimator: Estimator) -> tuple[float, float]:
    """Median and p99 (us) of onnxruntime for 16 readings, of a file with a set posterior."""
    sets = estimator.sets
    assert sets is not None
    feed = sets.feed(sets.rows(readings()), sets.start())
    names = [*(SET_PREFIX + name for name in SET_OUTPUTS), *MEMORY_OUTPUTS]
    return timed(lambda: estimator.session.run(names, feed), CALLS // 8)


def steps() -> str:
    """Time (us) of one more torque reading by `step`, by the readings before it."""
    lines = [
        "One more reading by `step`, by the readings before it: median processor time, all in "
        "turn. Goal: at 200 within 20 % of 8.",
        "",
        "| file | readings before | rows of the memory | us | over that at 8 |",
        "|---|---:|---:|---:|---:|",
    ]
    for name in ("wheel", "any_wheel"):
        estimator = Estimator.load(ROOT / "exported" / f"{name}.onnx")
        estimator = for_simulated_case(estimator, read_recipe("wheel").case)
        memories = [_memory_of(estimator, count) for count in STEPS]
        calls = [lambda e=estimator, m=m: e.step(m, **reading()) for m in memories]
        taken = processor_times(calls, CALLS // 8)
        lines += [
            f"| {name}.onnx | {count} | {len(memory.system)} | {us:.0f} | {us / taken[0]:.2f} |"
            for count, memory, us in zip(STEPS, memories, taken, strict=True)
        ]
    return "\n".join(lines)


def processor_times(calls, count: int) -> list[float]:  # type: ignore[no-untyped-def]
    """Median processor time (us) of each of several calls, which are made in turn."""
    taken = np.empty((len(calls), count))
    for i in range(-20, count):
        for k, call in enumerate(calls):
            started = time.thread_time()
            call()
            taken[k, i] = time.thread_time() - started
    return [float(us) for us in np.median(taken, axis=1) * 1e6]


def _memory_of(estimator: Estimator, count: int) -> Memory:
    """The memory of readings of one soil, in steps of eight."""
    rng, memory = np.random.default_rng(0), estimator.start()
    slip, load = rng.uniform(0.08, 0.55, count), rng.uniform(40.0, 110.0, count)
    force = Model(Wheel(radius=0.15, width=0.12))(
        soil("wong1989/dry_sand"), Operating(slip=slip, load=load)
    )
    torque = force.torque * (1.0 + 0.02 * rng.standard_normal(count))
    for at in range(0, count, 8):
        part = slice(at, at + 8)
        rows = {"slip": slip[part], "load": load[part], "torque": torque[part]}
        _, memory = estimator.step(memory, **rows)
    return memory


def cold_start() -> str:
    """Import, load, verification and first estimate in a new process."""
    path = str(ROOT / "exported" / "wheel.onnx")
    runs = []
    for _ in range(5):
        done = subprocess.run(
            [sys.executable, "-c", COLD.format(path=path)],
            capture_output=True,
            text=True,
            check=True,
        )
        runs.append([float(x) for x in done.stdout.split()])
    seconds, memory = np.min(runs, axis=0)
    return (
        f"From import to the first estimate, load, checksums and self-test included: "
        f"{seconds:.3f} s (best of 5); resident memory {memory:.0f} MB."
    )


def reading() -> dict[str, float]:
    return {"slip": 0.3, "torque": 3.0, "load": 60.0}


def readings() -> dict[str, np.ndarray]:
    """Sixteen readings of one soil."""
    slip, load = np.linspace(0.08, 0.55, 16), np.tile([40.0, 75.0, 110.0, 90.0], 4)
    force = Model(Wheel(radius=0.15, width=0.12))(
        soil("wong1989/dry_sand"), Operating(slip=slip, load=load)
    )
    return {"slip": slip, "load": load, "torque": force.torque}


def timed(call, count: int = CALLS) -> tuple[float, float]:  # type: ignore[no-untyped-def]
    """Median and p99 (us) of a call."""
    for _ in range(50):
        call()
    taken = np.empty(count)
    for i in range(count):
        started = time.perf_counter()
        call()
        taken[i] = time.perf_counter() - started
    return float(np.median(taken) * 1e6), float(np.quantile(taken, 0.99) * 1e6)
