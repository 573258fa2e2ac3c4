"""Exported C files: latency beside onnxruntime, memory, stack and instructions."""

from __future__ import annotations

import ctypes
import re
import sys
import tempfile
import time
from contextlib import redirect_stdout
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from board import OUTPUTS, READING, estimator_of, readings
from c_call_graph import call_graph
from compiled_c import COMPILERS, ROOT, CompiledModel, compile_library
from emulated_board import MISSING, run_on_board
from runner import Bench, Row, Sample, markdown, member, table
from simulated_rows import ANY_WHEEL, rows_of

from soilml import Estimator
from soilml.cli import main
from soilml.onboard.set_contract import MEMORY_OUTPUTS, SET_OUTPUTS, SET_PREFIX
from training.export_c.single_precision import in_single_precision

FILES = ("wheel", "wheel_lssvm", "wheel_mlp", "wheel_linear", "any_wheel", "kls1_wheel")
COMPARED, SMALL = ("wheel", "any_wheel"), ("wheel_small", "any_wheel_small")
#: Files with a set posterior, and those of single readings.
WITH_SETS = ("wheel", "any_wheel", "kls1_wheel", *SMALL)
SINGLES = ("wheel_linear", "wheel_mlp", "wheel_lssvm", "slip_torque")
CALLS, QUICK_CALLS = 600, 40
SINGLE = "one reading"
#: Rows that the emulated board steps through, and the seed of their noise.
ROWS, SEED = 60, 8
ABOUT_LATENCY = (
    "`soilml export c` (gcc -O2) beside onnxruntime, one thread. Microseconds of processor time, "
    "all in turn: median and 99th percentile. *Step*: one more row and the answer, by the rows in "
    "the memory. *Noise alone*: a case without errors of sensors and model, for which graph and C "
    "have a branch; *with errors*: those that the file has by itself. C is called through ctypes, "
    "which adds about one microsecond. Goal: half of the latency of onnxruntime."
)
ABOUT_MEMORY = (
    "What generated C needs at most: bytes that the headers state, by the rows that a step takes; "
    "stack of the deepest path of calls, as gcc -O2 states it for this processor; instructions of "
    f"the costliest of {ROWS} rows of all channels with its answer, and stack, on an emulated "
    "Cortex-M4F (`qemu-system-arm -M mps2-an386`); and by how much answers of single readings "
    "would differ in float, in standard deviations of the prior. Goals of the small files: 64 kB "
    "of constants, 24 kB of working memory, 4 kB of state, 2 million instructions. At 168 MHz and "
    "two cycles an instruction, 2 million take 24 ms."
)

#: Sizes that a header states.
SIZES = r"#define \w+_(WORK|MEMORY|TRACKER|CONSTANT)_BYTES (\d+)"


@cache
def folder() -> Path:
    """A folder of this process for generated files."""
    return Path(tempfile.mkdtemp(prefix="soilml-c-"))


def generated(name: str, rows: int = 32) -> Path:
    """The C file of a released file."""
    source = folder() / f"rows_{rows}" / f"{name}.c"
    source.parent.mkdir(exist_ok=True)
    if not source.exists():
        model = str(ROOT / "exported" / f"{name}.onnx")
        with redirect_stdout(sys.stderr):
            if main(["export", "c", model, str(source), "--step-rows", str(rows)]):
                sys.exit(f"{name}.onnx cannot be exported")
    return source


@cache
def compiled(name: str) -> CompiledModel:
    """A released file as compiled C."""
    source = generated(name)
    library = compile_library(source, source.with_suffix(".so"), COMPILERS[0], "-O2")
    return CompiledModel(source.with_suffix(".h"), library)


def latency_cases(sample: Sample) -> list[Row]:
    """Each file; none where there is no C compiler."""
    calls = QUICK_CALLS if sample.quick else CALLS
    return [{"file": name, "calls": calls} for name in FILES if COMPILERS]


def latency(case: Row) -> list[Row]:
    """Median and 99th percentile (us) of the same work in onnxruntime and in C."""
    name, found = case["file"], []
    exact, file = estimator_of(name), Estimator.load(ROOT / "exported" / f"{name}.onnx")
    asked = [("", exact)]
    if exact.sets is not None and file.sets is not None:
        usual = replace(exact.sets, common_errors=file.sets.common_errors)
        asked = [(", noise alone", exact), (", with errors", replace(exact, sets=usual))]
    for label, estimator in asked:
        for what, outputs, feed, by_c in tasks(name, compiled(name), estimator):

            def run(e=estimator, o=outputs, f=feed) -> None:  # type: ignore[no-untyped-def]
                e.session.run(o, f)

            times = processor_times(case["calls"], run, by_c)
            found.append({"what": f"{what}{'' if what == SINGLE else label}", "us": times})
    return found


def processor_times(calls: int, *works: Any) -> list[float]:
    """Median and 99th percentile (us) of the processor time of each, in turn."""
    found: list[list[float]] = [[] for _ in works]
    for _ in range(calls // 20):
        for work, times in zip(works, found, strict=True):
            for _ in range(20):
                begin = time.process_time_ns()
                work()
                times.append((time.process_time_ns() - begin) / 1e3)
    return [float(np.quantile(times, q)) for times in found for q in (0.5, 0.99)]


def tasks(name: str, model: CompiledModel, estimator: Estimator) -> Any:
    """What is timed: a name, outputs and inputs of onnxruntime, and a call of the C library."""
    library, reference, work = model.library, ctypes.byref, ctypes.byref(model.work)
    sets = estimator.sets
    if not (sets and (sets.sets_only or sets.common_errors["model_error"])):
        feed = {n: np.asarray([v], np.float32) for n, v in READING.items()}
        row, estimate = model.row(**READING), model.new("estimate")
        single = getattr(library, f"{name}_single")
        arguments = reference(row), reference(estimate), work
        yield SINGLE, OUTPUTS, feed, lambda: single(*arguments)
    if sets is None or name == "kls1_wheel":  # the rows are of another wheel
        return
    names = [*(SET_PREFIX + output for output in SET_OUTPUTS), *MEMORY_OUTPUTS]
    update = getattr(library, f"{name}_set_step")
    found, many = model.new("set_estimate"), readings()
    fields = [field for field, _ in model.structs[f"{name}_row"]._fields_]

    def same_rows(feed: dict[str, Any]) -> Any:
        """The rows that onnxruntime is fed, with their noise, as C takes them."""
        return model.rows(**{field: feed[field] for field in fields if field in feed})

    for what, before, count in (("set of 16", 0, 16), ("step at 8", 8, 1), ("step at 200", 200, 1)):
        rows = {k: np.resize(v, before + count).astype(np.float32) for k, v in many.items()}
        own = model.start(**sets.context_values, **sets.common_errors)
        memory = estimator.start()
        for first in range(0, before, 16):
            part = {k: v[first : min(first + 16, before)] for k, v in rows.items()}
            model.step(own, same_rows(sets.feed(sets.rows(part), memory.packed())))
            _, memory = estimator.step(memory, **part)
        feed = sets.feed(sets.rows({k: v[before:] for k, v in rows.items()}), memory.packed())
        given, kept = same_rows(feed), bytes(own)

        def by_c(own=own, given=given, kept=kept, count=count):  # type: ignore[no-untyped-def]
            ctypes.memmove(reference(own), kept, len(kept))
            update(reference(own), given, count, None, reference(found), work)

        yield what, names, feed, by_c


def latency_table(rows: list[Row]) -> str:
    """A line for each task."""
    lines = [(r["file"], r["what"], *(f"{t:.0f}" for t in r["us"])) for r in rows]
    return markdown(("file", "what", "onnxruntime", "p99", "C", "p99"), lines, 2)


def memory_cases(sample: Sample) -> list[Row]:
    """Each file, the smallest alone for a quick look."""
    return [{"file": name} for name in (SMALL[:1] if sample.quick else (*WITH_SETS, *SINGLES))]


def memory(case: Row) -> Row:
    """Memory, stack, instructions and precision of a file."""
    name, found = case["file"], {}
    if name in WITH_SETS:
        sizes = {}
        for rows in (1, 32):
            header = generated(name, rows).with_suffix(".h").read_text()
            for part, size in re.findall(SIZES, header):
                sizes[part, rows] = f"{int(size) / 1e3:.1f}"
        found = {"constants": sizes["CONSTANT", 1], "state": sizes["MEMORY", 1]}
        found["tracker"] = sizes["TRACKER", 1]
        found |= {"work 1": sizes["WORK", 1], "work 32": sizes["WORK", 32]}
    if COMPILERS:
        graph = call_graph(generated(name), folder() / f"{name}.o")
        found["stack"] = graph.deepest_of_all()[0]
    if name in (*COMPARED, *SMALL) and not MISSING:  # files of the recipe's wheel, or of any
        context = ANY_WHEEL if name.startswith("any") else None
        rows = rows_of(np.random.default_rng(SEED), ROWS, context, ("sinkage", "drawbar_pull"))
        told = run_on_board(generated(name, 1).parent, name, rows, context)
        counts = np.array([answer.instructions for answer in told]) / 1e6
        found |= {"instructions": f"{np.median(counts):.2f}", "most": f"{counts.max():.2f}"}
        found |= {"board stack": max(answer.stack for answer in told)}
    if not name.startswith("any"):
        model = onnx.load(ROOT / "exported" / f"{name}.onnx")
        metadata = {entry.key: entry.value for entry in model.metadata_props}
        header = generated(name).with_suffix(".h").read_text()
        found["float"] = f"{in_single_precision(model, metadata)[1]:.0e}"
        found["computed"] = "double" if "double doubles[" in header else "float"
    return found


#: Headings of the table, by member.
MEMORY_COLUMNS = {
    "constants, kB": "constants",
    "state of a set": "state",
    "tracker": "tracker",
    "work, --step-rows 1": "work 1",
    "work, --step-rows 32": "work 32",
    "stack here, bytes": "stack",
    "Cortex-M4F, million instructions": "instructions",
    "most": "most",
    "stack there, bytes": "board stack",
    "change in float": "float",
    "computed in": "computed",
}


def memory_table(rows: list[Row]) -> str:
    """A line for each file."""
    return table(
        rows, {"file": "file"}, {title: member(key) for title, key in MEMORY_COLUMNS.items()}
    )


C_LATENCY = Bench(
    "c", "Exported C files: latency", ABOUT_LATENCY, latency_cases, latency, latency_table,
    timed=True,
)  # fmt: skip
C_MEMORY = Bench(
    "c-memory", "Exported C files: memory and instructions", ABOUT_MEMORY, memory_cases, memory,
    memory_table,
)  # fmt: skip
