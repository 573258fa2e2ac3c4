"""What generated C needs at most, for a reviewer: memory, stack, instructions, precision.

`python bench/c_review.py [memory stack instructions precision]` prints tables for docs/c-export.md
and docs/c-review.md. Instructions are
counted on an emulated Cortex-M4F, rows of all channels until the memory of a set is full.
"""

from __future__ import annotations

import re
import sys
import tempfile
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import onnx

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from c_call_graph import call_graph
from emulated_board import MISSING, run_on_board
from simulated_rows import ANY_WHEEL, rows_of

from soilml.cli import main as soilml
from soilml.io.text_tables import format_table
from training.export_c.single_precision import change_by_single_precision

ROOT = Path(__file__).parents[1]
SKIPPED = 77  # Exit status where something that is asked for is not installed
SETS = ("wheel", "any_wheel", "kls1_wheel", "wheel_small", "any_wheel_small")
SINGLES = ("wheel_linear", "wheel_mlp", "wheel_lssvm", "slip_torque")
#: Sizes that a header states.
SIZES = r"#define \w+_(WORK|MEMORY|TRACKER|CONSTANT)_BYTES (\d+)"
#: Rows that the emulated board steps through, and the seed of their noise.
ROWS, SEED = 60, 8
#: Files of the recipe's wheel, or of any: `kls1_wheel` is for another one.
EMULATED = ("wheel", "any_wheel", "wheel_small", "any_wheel_small")


def main() -> None:
    """Print the tables of the arguments; all by default, but for what is not installed here."""
    tables = {
        "memory": memory,
        "stack": stack,
        "instructions": instructions,
        "precision": precision,
    }
    asked = sys.argv[1:] or [name for name in tables if name != "instructions" or not MISSING]
    if "instructions" in asked and MISSING:
        print(f"not installed: {', '.join(MISSING)}", file=sys.stderr)
        sys.exit(SKIPPED)
    with tempfile.TemporaryDirectory() as name:
        for table in asked:
            print(f"{tables[table](Path(name))}\n", flush=True)


def exported(folder: Path, name: str, rows: int) -> Path:
    """The C file of a released file."""
    source = folder / f"rows_{rows}" / f"{name}.c"
    source.parent.mkdir(exist_ok=True)
    if not source.exists():
        model = str(ROOT / "exported" / f"{name}.onnx")
        with redirect_stdout(sys.stderr):
            failed = soilml(["export-c", model, str(source), "--rows", str(rows)])
        if failed:
            sys.exit(f"{name}.onnx cannot be exported")
    return source


def memory(folder: Path) -> str:
    """Bytes that the headers state, by the rows that a step takes."""
    lines = []
    for name in SETS:
        sizes = {}
        for rows in (1, 32):
            header = exported(folder, name, rows).with_suffix(".h").read_text()
            for part, size in re.findall(SIZES, header):
                sizes[part, rows] = f"{int(size) / 1e3:.1f}"
        parts = ("CONSTANT", 1), ("MEMORY", 1), ("TRACKER", 1), ("WORK", 1), ("WORK", 32)
        lines.append((name, *(sizes[part] for part in parts)))
    head = ("memory, kB", "constants", "state of a set", "tracker", "work, --rows 1")
    return format_table((*head, "work, --rows 32"), lines)


def stack(folder: Path) -> str:
    """Bytes of the deepest path of calls, as gcc states them for this processor."""
    lines = []
    for name in (*SETS, *SINGLES):
        source = exported(folder, name, 32)
        size, path = call_graph(source, folder / "made.o").deepest_of_all()
        other = rf"^.*:|^{name}_|\.(part|constprop|isra).*$"  # file, prefix, variants of gcc
        functions = [re.sub(other, "", function) for function in path]
        lines.append((name, str(size), " > ".join(functions)))
    return format_table(("stack by gcc -O2, bytes", "most", "path"), lines)


def instructions(folder: Path) -> str:
    """Instructions of the costliest of some rows with its answer, and stack, on a Cortex-M4F."""
    lines = []
    for name in EMULATED:
        context = ANY_WHEEL if name.startswith("any") else None
        channels = ("sinkage", "drawbar_pull")
        rows = rows_of(np.random.default_rng(SEED), ROWS, context, channels)
        found = run_on_board(exported(folder, name, 1).parent, name, rows, context)
        counts = np.array([answer.instructions for answer in found]) / 1e6
        most = max(answer.stack for answer in found)
        lines.append((name, f"{np.median(counts):.2f}", f"{counts.max():.2f}", str(most)))
    head = ("update of one row, Cortex-M4F", "million instructions", "most", "stack, bytes")
    return format_table(head, lines)


def precision(folder: Path) -> str:
    """By how much answers of single readings would differ in float, and what the files use."""
    lines = []
    for name in (*SINGLES, "wheel", "kls1_wheel", "wheel_small"):
        model = onnx.load(ROOT / "exported" / f"{name}.onnx")
        metadata = {entry.key: entry.value for entry in model.metadata_props}
        change = change_by_single_precision(model, metadata)
        header = exported(folder, name, 32).with_suffix(".h").read_text()
        used = "double" if "double doubles[" in header else "float"
        lines.append((name, f"{change:.0e}", used))
    return format_table(("single readings", "change in float, std of prior", "computed in"), lines)


if __name__ == "__main__":
    main()
