"""`soilml train`: from data to a model file for on-board use."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from soilml.cli.options import OPTIONAL, InputFile
from soilml.errors import InputError
from soilml.io.atomic_files import atomic_outputs, output_files

DESCRIPTION = """\
Train the regressors of SPEC.toml on all rows of DATA.parquet, calibrate their
uncertainty by fits without each row's run, and export one ONNX file.

  soilml train spec.toml data.parquet wheel.onnx
  soilml train fused data.parquet wheel.onnx
  soilml train any_wheel any.onnx        for wheels of any size; needs no data

Packaged specs: fused, lssvm, mlp, linear, slip, ... Next to OUT.onnx, the
command writes the model card OUT.md. A spec contains

  features = ["slip", "torque/load", "load"]   # measured quantities or ratios
  targets = ["cohesion", "friction_angle", "shear_modulus"]
                                     # parameters in the recipe, or slip
  seed = 0
  [[regressor]]                      # one or more; several are fused
  type = "fixed-size-lssvm"          # centres; gamma, width (tuned if absent)
  centres = 150                      # features = [...]: a subset of the spec's
  [[regressor]]
  type = "mlp"                       # hidden = [32, 32], epochs, steps, ...
  [[regressor]]
  type = "linear"
  [set_posterior]                    # optional: pools all readings of a soil
  designs = 4096                     # by their likelihood, with a learned
  hidden = 64                        # response to slip, load and soil
  epochs = 500
  small = true                       # for a microcontroller: fewer monomials,
  terms = 14                         # 10 to 25; docs/how-to/deploy.md
"""
ARGUMENTS = (
    ("spec SPEC.toml", "spec file, or the name of a packaged spec", InputFile),
    ("data DATA.parquet", "data written by soilml generate, or measured", InputFile, OPTIONAL),
    ("out OUT.onnx", "model file to write"),
    "workers",
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return output_files(args.out, ".onnx", ".md")


def run(args: argparse.Namespace) -> int:
    """Train and export."""
    from soilml.optional_imports import need

    need("training.train", "train")
    from soilml.processes import limited_workers
    from training.spec import is_any_wheel_spec

    with limited_workers(args.workers):
        if is_any_wheel_spec(args.spec):
            return _any_wheel(args)
        if args.data is None:
            raise InputError(
                f"DATA.parquet is missing; {args.spec} is trained on data of soilml generate"
            )
        return _from_data(args)


def _any_wheel(args: argparse.Namespace) -> int:
    """Train the file for wheels of any size."""
    from soilml.cli.output import tell
    from soilml.cli.progress import stage_progress
    from training.export.model_card import any_wheel_card
    from training.export.model_file import export_any_wheel
    from training.spec import read_any_wheel_spec
    from training.train import train_sets

    if args.data is not None:
        raise InputError(f"{args.data}: {args.spec} simulates its own rows; leave the data out")
    spec, out = read_any_wheel_spec(args.spec), Path(args.out)
    with stage_progress() as progress:
        posterior, figures = train_sets(spec.family, spec.response, spec.noise, progress)
        with atomic_outputs(outputs(args)) as (model, page):
            metadata = export_any_wheel(spec, posterior, figures, model)
            page.write_text(
                any_wheel_card(metadata, posterior.family.inputs(), figures, out.stem),
                encoding="utf-8",
            )
    size = out.stat().st_size / 1e3
    tell(f"\nwritten: {out} ({size:.0f} kB), {out.with_suffix('.md')}")
    return 0


def _from_data(args: argparse.Namespace) -> int:
    """Train an estimator on a data file."""
    from soilml.cli.output import tell
    from soilml.cli.progress import stage_progress
    from soilml.quantities import QUANTITIES
    from soilml.report.aligned_text import format_table
    from training.dataset import read_dataset
    from training.export.model_card import model_card
    from training.export.model_file import export_model
    from training.spec import read_spec
    from training.train import train

    out = Path(args.out)
    spec = read_spec(args.spec)
    data = read_dataset(args.data, spec.features, spec.targets)
    with stage_progress() as progress:
        trained = train(spec, data, progress)
        progress("exporting", 0, 1)
        with atomic_outputs(outputs(args)) as (model, page):
            metadata = export_model(trained, model, args.data)
            page.write_text(model_card(trained, metadata, out.stem), encoding="utf-8")
        progress("exporting", 1, 1)
    rows = [
        (name, *[f"{v:.3f}" for v in s.relative], *[f"{v:.1%}" for v in s.cover90])
        for name, s in trained.scores.items()
    ]
    labels = [QUANTITIES[name].symbol if name in QUANTITIES else name for name in spec.targets]
    head = ("", *[f"RMSE {n}" for n in labels], *[f"cover {n}" for n in labels])
    kind = "rows, each by a fit without its run, on which the intervals are calibrated too"
    tell(
        f"On {trained.scores['estimator'].rows} {kind}: RMSE over the prior's standard "
        "deviation, and coverage of 90 % intervals\n"
    )
    print(format_table(head, rows), file=sys.stderr)
    tell(
        f"\nwritten: {out} ({out.stat().st_size / 1e3:.0f} kB; largest difference of the float32 "
        f"file {metadata['parity']} prior standard deviations), "
        f"{out.with_suffix('.md')}"
    )
    return 0
