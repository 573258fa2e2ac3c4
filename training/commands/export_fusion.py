"""`soilml export fusion`: the fusion of two model files as C code."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import InputFile
from soilml.io.atomic_files import atomic_outputs, output_files
from soilml.io.cell_text import one_line
from training.export_c.c_names import check_c_name

DESCRIPTION = """\
Write the fusion of two files that estimate the same quantity from different
sensors, such as slip from torque and from vibration, as the C file OUT.c and
its header OUT.h. They use the structs that export c writes for each file.

  soilml export c exported/slip_torque.onnx slip_torque.c
  soilml export c exported/slip_vibration.onnx slip_vibration.c
  soilml export fusion exported/slip_torque.onnx \\
      exported/slip_vibration.onnx slip.c

slip_fuse() weighs the estimates by their variances and by the correlation of
their errors, which are in the files. docs/how-to/deploy.md describes it.
"""


ARGUMENTS = (
    ("first FIRST.onnx", "a file, named as its C file", InputFile),
    ("second SECOND.onnx", "the other one", InputFile),
    ("out OUT.c", "C file to write; OUT.h is written beside it"),
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return output_files(args.out, ".c", ".h")


def run(args: argparse.Namespace) -> int:
    """Write the fusion of the files."""
    from soilml.cli.output import tell
    from soilml.optional_imports import need

    need("jinja2", "export fusion")
    from soilml.onboard.estimator import Estimator
    from soilml.onboard.model_file import find_model
    from training.export_c.fusion import write_fusion

    out, files = Path(args.out), [find_model(model) for model in (args.first, args.second)]
    for name in (out, *(file.with_suffix(".c") for file in files)):
        check_c_name(name)
    estimators = [Estimator.load(file) for file in files]
    texts = write_fusion(estimators, [file.stem for file in files], out.stem)
    with atomic_outputs(outputs(args)) as written:
        for file, text in zip(written, texts, strict=True):
            file.write_text(text, encoding="utf-8")
    tell(f"written: {one_line(out)}, {one_line(out.with_suffix('.h'))}")
    return 0
