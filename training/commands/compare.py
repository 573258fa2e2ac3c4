"""`soilml compare`: trained models against analytic identification and the prior."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from soilml.errors import InputError
from soilml.needs import need
from soilml.saving import made_folder, replacing_all

#: What goes into the folder.
FILES = ("compare.csv", "compare.png", "compare.md")

HELP = "models against analytic identification and the prior, on the same data"
DESCRIPTION = """\
Score model files and analytic identification on measured sets whose soil is known.

  soilml compare MODEL.toml test.parquet wheel.onnx other.onnx --out comparison

TEST.parquet comes from soilml generate with a seed that was not trained on; its runs are the sets:
single rows, and rows of one soil together. MODEL.toml gives the analytic methods their wheel, soil,
priors and noise; its wheel, soil, effects and priors must be those of the test data. Into the
folder go compare.md, compare.csv and compare.png.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", metavar="MODEL.toml")
    parser.add_argument("test", metavar="TEST.parquet")
    parser.add_argument("files", metavar="MODEL.onnx", nargs="+")
    parser.add_argument("--out", metavar="DIR", required=True, help="folder for table and picture")
    parser.add_argument(
        "--analytic-sets",
        type=_sets,
        default=120,
        help="sets of a size for analytic methods",
    )


def _sets(text: str) -> int:
    """A number of sets; raises `ArgumentTypeError` for none."""
    if not text.isdecimal() or not 1 <= len(text) <= 9 or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} given; needed is a whole number, 1 or more")
    return int(text)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes, where their folder is there already."""
    folder = Path(args.out)
    return [folder / name for name in FILES] if folder.is_dir() else []


def run(args: argparse.Namespace) -> int:
    """Compare and write the results."""
    need("training.compare", "compare")
    from datagen.progress import stages
    from soilml.case import read_case
    from soilml.onboard import Estimator
    from soilml.reading import read_table
    from soilml.writing import csv_text
    from training import comparison_report as report
    from training.alike import check_alike
    from training.compare import compare

    case = read_case(args.model)
    table = read_table(args.test, ("run", "slip", "load_N", "torque_Nm"), filled=("run",))
    estimators = {Path(file).stem: Estimator.load(file) for file in args.files}
    if len(estimators) != len(args.files):
        raise InputError("two model files have the same name: rename one, names label the lines")
    names = next(iter(estimators.values())).names
    for note in check_alike(case, table, estimators, names):
        print(note, file=sys.stderr)
    with made_folder(args.out) as folder:
        with stages() as progress:
            lines = compare(case, table, estimators, progress, args.analytic_sets)
        with replacing_all([folder / name for name in FILES]) as (rows, picture, page):
            rows.write_text(csv_text(report.columns(lines, names)), encoding="utf-8")
            report.draw(lines, names, picture)
            page.write_text(report.page(lines, names, Path(args.test).name), encoding="utf-8")
    print(report.table(lines, names))
    print(f"\n{folder}/compare.md, compare.csv, compare.png", file=sys.stderr)
    return 0
