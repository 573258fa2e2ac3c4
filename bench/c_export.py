"""Exported C files beside onnxruntime: latency, differences of the answers."""

from __future__ import annotations

import ctypes
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from board import OUTPUTS, reading, readings
from compiled_c import COMPILERS, ROOT, CompiledModel, compile_library
from simulated_rows import context_of, rows_of

from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.cli import main
from soilml.identification.trained_estimator import for_simulated_case
from soilml.onboard.set_contract import MEMORY_OUTPUTS, SET_OUTPUTS, SET_PREFIX

FILES = ("wheel", "wheel_lssvm", "wheel_mlp", "wheel_linear", "any_wheel", "kls1_wheel")
FLAGS = ("-O2",)
CALLS, SETS, STREAMS = 600, 1000, 20
NAMES = ("mean", "std", "low", "high")
SINGLE = "one reading"


def c_export(folder: Path) -> str:
    """Tables of latency and differences; one line where there is no C compiler."""
    if not COMPILERS:
        return "No C compiler on this machine."
    models = {name: exported(name, folder) for name in FILES}
    version = subprocess.run([COMPILERS[0], "--version"], capture_output=True, text=True).stdout
    head = f"Compiled by {version.splitlines()[0]}, `{' '.join(FLAGS)}`."
    return "\n\n".join([head, latency_table(models), differences_table(models)])


def exported(name: str, folder: Path) -> CompiledModel:
    """A released file as compiled C."""
    source = folder / f"{name}.c"
    if main(["export-c", str(ROOT / "exported" / f"{name}.onnx"), str(source)]):
        sys.exit(f"{name}.onnx cannot be exported")
    library = compile_library(source, folder / f"{name}.so", COMPILERS[0], *FLAGS)
    return CompiledModel(folder / f"{name}.h", library)


def latency_table(models: dict[str, CompiledModel]) -> str:
    """Median and 99th percentile (us) of the same work in onnxruntime and in C."""
    lines = [
        "Microseconds of processor time, all in turn: median and 99th percentile. "
        "*Step*: one more row and the answer, by the rows in the memory. *Noise alone*: a case "
        "without errors of sensors and model, for which graph and C have a branch; *with errors*: "
        "those that the file has by itself. C is called through ctypes, which adds about one "
        "microsecond.",
        "",
        "| file | what | onnxruntime | p99 | C | p99 |",
        "|---|---|---:|---:|---:|---:|",
    ]
    case = read_recipe("wheel").case
    for name, model in models.items():
        file = Estimator.load(ROOT / "exported" / f"{name}.onnx")
        for label, estimator in with_and_without_errors(for_simulated_case(file, case), file):
            for what, outputs, feed, by_c in tasks(name, model, estimator):
                run = partial(estimator.session.run, outputs, feed)
                times = " | ".join(f"{t:.0f}" for t in processor_times(run, by_c))
                lines.append(f"| {name} | {what}{'' if what == SINGLE else label} | {times} |")
    return "\n".join(lines)


def with_and_without_errors(exact: Estimator, file: Estimator) -> list[tuple[str, Estimator]]:
    """The estimator with no errors but noise, and one with the errors that the file has by itself.

    The former alone for a file without a set posterior.
    """
    if exact.sets is None or file.sets is None:
        return [("", exact)]
    usual = replace(exact.sets, common_errors=file.sets.common_errors)
    return [(", noise alone", exact), (", with errors", replace(exact, sets=usual))]


def processor_times(*works):  # type: ignore[no-untyped-def]
    """Median and 99th percentile (us) of the processor time of each, in turn."""
    found = [[] for _ in works]
    for _ in range(CALLS // 20):
        for work, times in zip(works, found, strict=True):
            for _ in range(20):
                begin = time.process_time_ns()
                work()
                times.append((time.process_time_ns() - begin) / 1e3)
    return [float(np.quantile(times, q)) for times in found for q in (0.5, 0.99)]


def tasks(name, model, estimator):  # type: ignore[no-untyped-def]
    """What is timed: a name, outputs and inputs of onnxruntime, and a call of the C library."""
    library, reference, work = model.library, ctypes.byref, ctypes.byref(model.work)
    sets = estimator.sets
    if not (sets and (sets.sets_only or sets.common_errors["model_error"])):
        feed = {n: np.asarray([v], np.float32) for n, v in reading().items()}
        row, estimate = model.row(**reading()), model.new("estimate")
        single = getattr(library, f"{name}_single")
        arguments = reference(row), reference(estimate), work
        yield SINGLE, OUTPUTS, feed, lambda: single(*arguments)
    if sets is None or name == "kls1_wheel":  # the rows are of another wheel
        return
    names = [*(SET_PREFIX + output for output in SET_OUTPUTS), *MEMORY_OUTPUTS]
    update = getattr(library, f"{name}_set_update")
    found, many = model.new("set_estimate"), readings()
    for what, before, count in (("set of 16", 0, 16), ("step at 8", 8, 1), ("step at 200", 200, 1)):
        rows = {k: np.resize(v, before + count).astype(np.float32) for k, v in many.items()}
        own = model.start(**sets.context_values, **sets.common_errors)
        memory = estimator.start()
        for first in range(0, before, 16):
            part = {k: v[first : min(first + 16, before)] for k, v in rows.items()}
            model.step(own, _same_rows(name, model, sets.feed(sets.rows(part), memory.packed())))
            _, memory = estimator.step(memory, **part)
        feed = sets.feed(sets.rows({k: v[before:] for k, v in rows.items()}), memory.packed())
        given, kept = _same_rows(name, model, feed), bytes(own)

        def by_c(own=own, given=given, kept=kept, count=count):  # type: ignore[no-untyped-def]
            ctypes.memmove(reference(own), kept, len(kept))
            update(reference(own), given, count, None, reference(found), work)

        yield what, names, feed, by_c


def _same_rows(name, model, feed):  # type: ignore[no-untyped-def]
    """The rows that onnxruntime is fed, with their noise, as C takes them."""
    fields = [field for field, _ in model.structs[f"{name}_row"]._fields_]
    return model.rows(**{field: feed[field] for field in fields if field in feed})


def differences_table(models: dict[str, CompiledModel]) -> str:
    """Differences of answers: C from onnxruntime, and onnxruntime from itself in another order."""
    lines = [
        "Differences in standard deviations of the answer, largest of the three quantities. "
        f"Cases are {SETS} sets of 1 to 32 rows with absent channels, and {STREAMS} streams of "
        "300 rows in steps of 1 to 32. Beside them those of onnxruntime from itself, with the "
        "rows "
        "of each step in another order: rounding alone. *Flags*: sets whose `in_range` differs.",
        "",
        "| file | rows | of | median | 99 of 100 | largest | flags | rounding: median | 99 of 100 "
        "| largest |",
        "|---|---|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for name in ("wheel", "any_wheel"):
        for kind, compare, count in (("sets", _one_set, SETS), ("streams", _one_stream, STREAMS)):
            rng = np.random.default_rng(11)
            plain = Estimator.load(ROOT / "exported" / f"{name}.onnx")
            found = [compare(name, models[name], plain, rng) for _ in range(count)]
            parts = [part for part in found if part is not None]
            flags = sum(part[2] for part in parts)
            for what, columns in (("mean, std", slice(0, 2)), ("ends", slice(2, 4))):
                sides = [np.array([part[side][columns].max() for part in parts]) for side in (0, 1)]
                cells = [f"{np.quantile(s, q):.0e}" for s in sides for q in (0.5, 0.99, 1.0)]
                lines.append(
                    f"| {name} | {kind} | {what} | {' | '.join(cells[:3])} | {flags} "
                    f"| {' | '.join(cells[3:])} |"
                )
    return "\n".join(lines)


def _simulated(name, rng, count):  # type: ignore[no-untyped-def]
    context = context_of(rng) if name == "any_wheel" else {}
    rows = rows_of(rng, count, context or None)
    good = all(np.isfinite(rows[k]).all() for k in ("slip", "torque", "load"))
    return context, rows if good else None


def _one_set(name, model, plain, rng):  # type: ignore[no-untyped-def]
    """Differences of C and of another order, (4,) each, and whether flags differ."""
    context, rows = _simulated(name, rng, int(rng.integers(1, 33)))
    if rows is None:
        return None
    estimator = plain.on(**context) if context else plain
    order = rng.permutation(len(rows["slip"]))
    expected, _ = estimator.step(estimator.start(), **rows)
    other, _ = estimator.step(estimator.start(), **{k: v[order] for k, v in rows.items()})
    _, answer = model.update(model.start(**context), model.rows(**rows))
    rounding = _difference({k: getattr(other, k) for k in NAMES}, expected)
    return _difference(answer, expected), rounding, answer["in_range"] != bool(expected.in_range)


def _one_stream(name, model, plain, rng):  # type: ignore[no-untyped-def]
    """The same for a stream, whose other order is that of the rows of each step reversed."""
    context, rows = _simulated(name, rng, 300)
    if rows is None:
        return None
    estimator = plain.on(**context) if context else plain
    own, first = model.start(**context), 0
    memory = reversed_memory = estimator.start()
    while first < 300:
        count = int(rng.integers(1, 33))
        part = {k: v[first : first + count] for k, v in rows.items()}
        expected, memory = estimator.step(memory, **part)
        turned = {k: v[::-1] for k, v in part.items()}
        other, reversed_memory = estimator.step(reversed_memory, **turned)
        _, answer = model.update(own, model.rows(**part))
        first += count
    rounding = _difference({k: getattr(other, k) for k in NAMES}, expected)
    return _difference(answer, expected), rounding, answer["in_range"] != bool(expected.in_range)


def _difference(answer, expected):  # type: ignore[no-untyped-def]
    return np.array(
        [np.max(np.abs(answer[k] - getattr(expected, k)) / expected.std) for k in NAMES]
    )
