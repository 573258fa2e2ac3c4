"""`soilml show models`: the released model files."""

from __future__ import annotations

import argparse
import json

from soilml.errors import ModelFileError

DESCRIPTION = """\
List the released model files of this installation. A short name stands for the
file wherever a command reads a model file:

  soilml show models                     all files, one line each
  soilml estimate wheel             what one file is for
  soilml estimate wheel RUNS.csv    estimates by it
"""
ARGUMENTS = ()


def run(args: argparse.Namespace) -> int:
    """Print the list."""
    from soilml.onboard.estimator import Estimator
    from soilml.onboard.model_file import released_models
    from soilml.optional_imports import need
    from soilml.quantities import QUANTITIES, SHEAR
    from soilml.report.aligned_text import format_table

    need("onnxruntime", "show models")
    files = released_models()
    if not files:
        raise ModelFileError(
            "this installation has no released model files; train one with soilml train"
        )
    header = ("name", "gear: r, w", "reads", "estimates", "set", "kB")
    rows = []
    for name, file in files.items():
        estimator = Estimator.load(file)
        gear = dict(json.loads(estimator.metadata["gear"]))
        sizes = [f"{1e3 * gear[k]:.3g}" for k in ("radius", "width") if gear.get(k)]
        rows.append(
            (
                name,
                f"{gear.get('type', '')} {', '.join(sizes) or 'of any size'}",
                ", ".join(estimator.inputs),
                ", ".join(QUANTITIES[n].symbol if n in SHEAR else n for n in estimator.names),
                "no" if estimator.sets is None else "yes",
                f"{file.stat().st_size / 1000:.0f}",
            )
        )
    print(format_table(header, rows, text_columns=5))
    print("r, w: radius and width in mm; set: whether rows of a soil are pooled")
    print("c, phi, K: cohesion, friction angle, shear modulus")
    return 0
