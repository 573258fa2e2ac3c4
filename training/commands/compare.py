"""`soilml compare`: trained models against analytic identification and the prior."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from soilml.errors import InputError
from soilml.needs import need

HELP = "models against analytic identification and the prior, on the same data"
DESCRIPTION = """\
Score model files and analytic identification on measured sets whose soil is known.

  soilml compare MODEL.toml test.parquet wheel.onnx other.onnx --out comparison

TEST.parquet comes from soilml generate with a seed that was not trained on; its runs are the sets:
single rows, and rows of one soil together. MODEL.toml gives the analytic methods their wheel, soil,
priors and noise. Into the folder go compare.md, compare.csv and compare.png.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", metavar="MODEL.toml")
    parser.add_argument("test", metavar="TEST.parquet")
    parser.add_argument("files", metavar="MODEL.onnx", nargs="+")
    parser.add_argument("--out", metavar="DIR", required=True, help="folder for table and picture")
    parser.add_argument(
        "--analytic-sets", type=int, default=None, help="sets of a size for analytic methods"
    )


def run(args: argparse.Namespace) -> int:
    """Compare and write the results."""
    need("training.compare", "compare")
    from datagen.progress import stages
    from soilml.case import read_case
    from soilml.onboard import Estimator
    from soilml.reading import read_table
    from soilml.saving import save_text
    from soilml.writing import csv_text
    from training import comparison_report as report
    from training.compare import ANALYTIC_SETS, compare, same_wheel

    case = read_case(args.model)
    table = read_table(args.test, ("run", "slip", "load_N", "torque_Nm"), filled=("run",))
    estimators = {Path(file).stem: Estimator.load(file) for file in args.files}
    if len(estimators) != len(args.files):
        raise InputError("two model files have the same name: rename one, names label the lines")
    names = next(iter(estimators.values())).names
    same_wheel(case, table, estimators)
    with stages() as progress:
        lines = compare(case, table, estimators, progress, args.analytic_sets or ANALYTIC_SETS)
    folder = Path(args.out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made: {error.strerror}") from None
    save_text(folder / "compare.csv", csv_text(report.columns(lines, names)))
    report.draw(lines, names, folder / "compare.png")
    save_text(folder / "compare.md", report.page(lines, names, Path(args.test).name))
    print(report.table(lines, names))
    print(f"\n{folder}/compare.md, compare.csv, compare.png", file=sys.stderr)
    return 0
