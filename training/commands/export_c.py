"""`soilml export c`: a model file as C code for a board without Python."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.option_values import whole_number_from
from soilml.cli.options import InputFile
from soilml.io.atomic_files import atomic_outputs, output_files
from soilml.io.cell_text import one_line
from training.export_c.c_names import check_c_name

DESCRIPTION = """\
Write MODEL.onnx as the C file OUT.c and its header OUT.h: C99, libm alone,
no allocation; the header states the memory that is needed.

  soilml export c exported/wheel.onnx wheel.c
  gcc -std=c99 -O2 main.c wheel.c -lm

Functions, with NAME the name of OUT.c:

  NAME_single          the estimate from one row
  NAME_set_start       begin a set of rows of one soil
  NAME_set_step        add rows to a set, and estimate from all so far
  NAME_set_answer      the estimate from all rows so far
  NAME_set_check       the fault detector: the rows against the exact model
  NAME_tracker_start   begin a drive over soils that change
  NAME_tracker_read    one row of it: what it is, and the soil after it

docs/how-to/deploy.md describes them, with an example in C and one in C++.
"""
#: Rows of one step that the working memory may be asked for, and rows that a tracker remembers.
MOST_ROWS = 4096
LEAST_LENGTH = 16  # Fewest rows that a tracker remembers
ARGUMENTS = (
    ("model MODEL.onnx", "a model file", InputFile),
    ("out OUT.c", "C file to write; OUT.h is written beside it"),
    ("--step-rows N (32)", "rows of one step at most", whole_number_from(1, MOST_ROWS)),
    ("--length N (100)", "rows of a tracker", whole_number_from(LEAST_LENGTH, MOST_ROWS)),
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return output_files(args.out, ".c", ".h")


def run(args: argparse.Namespace) -> int:
    """Translate a model file."""
    from soilml.cli.output import tell
    from soilml.optional_imports import need

    need("onnx", "export c")
    import onnx

    from soilml.onboard.estimator import Estimator
    from soilml.onboard.model_file import find_model
    from training.export_c.c_file import write_c

    out = Path(args.out)
    check_c_name(out)
    file = find_model(args.model)
    metadata = Estimator.load(file).metadata
    written = write_c(
        onnx.load(str(file)), metadata, out.stem, file.name, args.step_rows, args.length
    )
    with atomic_outputs(outputs(args)) as (source, header):
        source.write_text(written.source, encoding="utf-8")
        header.write_text(written.header, encoding="utf-8")
    of_set = f"memory of a set {written.memory_bytes}, " if written.memory_bytes else ""
    tell(
        f"written: {one_line(out)} ({len(written.source) / 1e3:.0f} kB), "
        f"{one_line(out.with_suffix('.h'))}; bytes of constants "
        f"{written.constant_bytes}, {of_set}working memory {written.work_bytes}"
    )
    return 0
