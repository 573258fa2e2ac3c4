"""`soilml train`: from data to a model file that flies."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from soilml.errors import InputError
from soilml.io.atomic_files import named, replacing_all
from soilml.optional_imports import need

HELP = "fit regressors to data and export one ONNX file"
DESCRIPTION = """\
Fit what SPEC.toml names to DATA.parquet, recalibrate it on rows it did not learn from, export it.

  soilml train spec.toml data.parquet wheel.onnx
  soilml train fused data.parquet wheel.onnx     packaged specs: fused, lssvm, mlp, linear, slip ...
  soilml train any_wheel any.onnx                one file for wheels of any size; it needs no data

Beside OUT.onnx stand OUT.md, its card, and OUT.png, its learning curves. A spec holds

  features = ["slip", "torque/load", "load"]     # measured quantities, or ratios of them
  targets = ["cohesion", "friction_angle", "shear_modulus"]        # what the recipe varies, or slip
  rule = "best-linear"                           # or covariance-intersection, inverse-variance, ...
  seed = 0
  [[regressor]]                                  # one or more; several are fused
  type = "fixed-size-lssvm"                      # centres, gamma, width (chosen where left out)
  centres = 150                                  # features = [...]: some of the spec's alone
  [[regressor]]
  type = "mlp"                                   # hidden = [64, 64], epochs, batch, patience, ...
  [[regressor]]
  type = "linear"                                # or "lssvm", exact, for some thousand rows
  [set_posterior]                                # optional: all readings of one soil together, by
  designs = 4096                                 # their exact likelihood under a learned response
  hidden = 64                                    # of the wheel to slip, load and soil
  epochs = 500
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("spec", metavar="SPEC.toml", help="or the name of a packaged spec")
    parser.add_argument("data", metavar="DATA.parquet", nargs="?", help="from soilml generate")
    parser.add_argument("out", metavar="OUT.onnx")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return named(args.out, ".onnx", ".md", ".png")


def run(args: argparse.Namespace) -> int:
    """Train and export."""
    need("training.train", "train")
    from training.export.any_wheel_file import is_for_any_wheel

    if is_for_any_wheel(args.spec):
        return _any_wheel(args)
    if args.data is None:
        raise InputError(f"DATA.parquet is missing; {args.spec} learns from data: soilml generate")
    return _from_data(args)


def _any_wheel(args: argparse.Namespace) -> int:
    """Train the file for wheels of any size."""
    from soilml.cli.progress import stages
    from training.export.any_wheel_file import card, export, read_any_spec, trained

    if args.data is not None:
        raise InputError(f"{args.data}: {args.spec} simulates its own rows; leave the data out")
    spec, out = read_any_spec(args.spec), Path(args.out)
    with stages() as progress:
        posterior, figures = trained(spec, progress)
        with replacing_all(outputs(args)[:2]) as (model, page):
            metadata = export(spec, posterior, figures, model)
            page.write_text(card(metadata, posterior, figures), encoding="utf-8")
    size = out.stat().st_size / 1e3
    print(f"\n{out} ({size:.0f} kB), {out.with_suffix('.md')}", file=sys.stderr)
    return 0


def _from_data(args: argparse.Namespace) -> int:
    """Train what learns from data."""
    from soilml.cli.progress import stages
    from soilml.io.text_tables import aligned
    from training.data.dataset import read_dataset
    from training.export.learning_curves import draw_curves
    from training.export.model_card import card
    from training.export.model_file import export
    from training.spec import read_spec
    from training.train import train

    out = Path(args.out)
    spec = read_spec(args.spec)
    data = read_dataset(args.data, spec.features, spec.targets)
    with stages() as progress:
        trained = train(spec, data, progress)
        progress("exporting", 0, 2)
        with replacing_all(outputs(args)) as (model, page, picture):
            metadata = export(trained, model, args.data)
            progress("exporting", 1, 2)
            draw_curves(trained, picture)
            page.write_text(card(trained, metadata, out.stem), encoding="utf-8")
        progress("exporting", 2, 2)
    rows = [
        (name, *[f"{v:.3f}" for v in s.relative], *[f"{v:.1%}" for v in s.cover90])
        for name, s in trained.scores.items()
    ]
    short = [name.replace("_", " ") for name in spec.targets]
    head = ("", *[f"RMSE/prior {n}" for n in short], *[f"90 % {n}" for n in short])
    print(f"On {trained.scores['estimator'].rows} rows not learned from:\n", file=sys.stderr)
    print(aligned(head, rows), file=sys.stderr)
    print(
        f"\n{out} ({out.stat().st_size / 1e3:.0f} kB, parity {metadata['parity']} of the prior), "
        f"{out.with_suffix('.md')}, {out.with_suffix('.png')}",
        file=sys.stderr,
    )
    return 0
