"""`soilml compare`: trained models against analytic identification and the prior."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from soilml.errors import InputError
from soilml.io.atomic_files import made_folder, named, replacing_all
from soilml.optional_imports import need

#: What goes into the folder, on one's own test data and of the benchmark.
FILES = ("compare.csv", "compare.png", "compare.md")
BENCHMARK = ("benchmark.csv", "benchmark.png", "benchmark.md")
#: Where the benchmark's go without --out, and the files that it is of without arguments.
FOLDER = "demo/benchmark"
RELEASED = ("wheel", "wheel_lssvm", "wheel_mlp", "wheel_linear", "any_wheel")

HELP = "models against analytic identification and the prior, on the same data"
DESCRIPTION = """\
Score model files and analytic identification on measured sets whose soil is known.

  soilml compare
  soilml compare mine.onnx other.onnx --sets 50 --out comparison

is the fixed benchmark: sets of 1 to 18 rows at one load and at three, made from the packaged recipe
`benchmark`, with the Bayes limit of the same sets beside every method. Without a file it is of the
released models, in a clone of the repository. Into the folder go benchmark.md, .csv and .png.

  soilml compare MODEL.toml test.parquet wheel.onnx other.onnx --out comparison

is on data of your own. TEST.parquet comes from soilml generate with a seed that was not trained on;
its runs are the sets: single rows, and rows of one soil together. MODEL.toml gives the analytic
methods their wheel, soil, priors and noise; its wheel, soil, effects and priors must be those of
the test data. Into the folder go compare.md, compare.csv and compare.png.

  soilml compare --limit limit.parquet

computes the Bayes limit of the benchmark anew, in two processes.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="*",
        help="MODEL.onnx ..., or MODEL.toml TEST.parquet MODEL.onnx ...; else exported/wheel*.onnx",
    )
    parser.add_argument(
        "--out", metavar="DIR", help=f"folder for table and picture; of the benchmark {FOLDER}"
    )
    parser.add_argument(
        "--sets", type=_sets, metavar="N", help="only the first N sets of each size"
    )
    parser.add_argument(
        "--limit",
        metavar="FILE.parquet",
        type=Path,  # an output: what is there already may be written over
        help="write the benchmark's Bayes limit here, no more",
    )
    parser.add_argument(
        "--against", metavar="FILE.parquet", help="the limit to use, of --limit; else the package's"
    )
    parser.add_argument(
        "--analytic-sets",
        type=_sets,
        default=120,
        help="on data of your own: sets of a size for analytic methods",
    )


def _sets(text: str) -> int:
    """A number of sets; raises `ArgumentTypeError` for none."""
    if not text.isdecimal() or not 1 <= len(text) <= 9 or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} given; needed is a whole number, 1 or more")
    return int(text)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes, where their folder is there already."""
    if args.limit is not None:
        return named(str(args.limit), ".parquet")
    folder = Path(args.out or FOLDER)
    names = FILES if _own_data(args) else BENCHMARK
    return [folder / name for name in names] if folder.is_dir() else []


def _own_data(args: argparse.Namespace) -> bool:
    """Whether a model file and test data are given; model files alone are for the benchmark."""
    return any(Path(file).suffix.lower() != ".onnx" for file in args.files)


def run(args: argparse.Namespace) -> int:
    """Compare and write the results."""
    need("training.benchmark.suite", "compare")
    if args.limit is not None:
        return _limit(args)
    return _compare(args) if _own_data(args) else _benchmark(args)


def _benchmark(args: argparse.Namespace) -> int:
    from datagen.recipe import read_recipe
    from soilml.cli.progress import stages
    from soilml.identification.trained_estimator import for_simulated_case
    from soilml.io.table import Table
    from soilml.io.text_tables import csv_text
    from soilml.onboard.estimator import Estimator
    from soilml.quantities import SHEAR
    from training.benchmark import report
    from training.benchmark.acceptance import goals
    from training.benchmark.plot import draw
    from training.benchmark.provenance import check_same_provenance
    from training.benchmark.suite import LIMIT, RECIPE, benchmark

    files = [Path(file) for file in args.files] or _released()
    case = read_recipe(RECIPE).case
    estimators = {file.stem: for_simulated_case(Estimator.load(file), case) for file in files}
    _check_labels(estimators, files)
    for note in check_same_provenance(case, Table({}, f"recipe {RECIPE}"), estimators, SHEAR):
        print(note, file=sys.stderr)
    with made_folder(args.out or FOLDER) as folder:
        with stages() as progress:
            results = benchmark(estimators, None, args.sets, args.against, progress)
        with replacing_all([folder / name for name in BENCHMARK]) as (rows, picture, page):
            rows.write_text(csv_text(report.columns(results)), encoding="utf-8")
            draw(results, LIMIT, picture)
            page.write_text(report.page(results, LIMIT), encoding="utf-8")
    print(f"{report.tables(results)}\n\n{report.goal_table(goals(results, LIMIT))}")
    print(f"\n{folder}/{', '.join(BENCHMARK)}", file=sys.stderr)
    return 0


def _released() -> list[Path]:
    """The model files that the repository comes with."""
    files = [Path("exported") / f"{name}.onnx" for name in RELEASED]
    missing = [file for file in files if not file.is_file()]
    if missing:
        raise InputError(
            f"no model file given, and there is no {missing[0]} here: run it in a clone of the "
            "repository, or give one or more MODEL.onnx"
        )
    return files


def _limit(args: argparse.Namespace) -> int:
    from datagen.recipe import read_recipe
    from soilml.cli.progress import stages
    from soilml.quantities import SHEAR
    from training.benchmark.bayes_limit import computed, jobs
    from training.benchmark.bayes_limit_file import save
    from training.benchmark.suite import RECIPE

    if args.files or args.out or args.against:
        raise InputError("--limit writes its file and nothing else: leave the other arguments out")
    wanted = jobs(read_recipe(RECIPE), SHEAR, args.sets)
    with stages() as progress:
        found = list(computed(wanted, progress))
    save(args.limit, wanted, found)
    print(f"{args.limit}: the Bayes limit of {len(wanted)} sets", file=sys.stderr)
    return 0


def _check_labels(estimators: Mapping[str, object], files: Sequence[object]) -> None:
    if len(estimators) != len(files):
        raise InputError("two model files have the same name: rename one, names label the lines")


def _compare(args: argparse.Namespace) -> int:
    from soilml.cli.progress import stages
    from soilml.config.case import read_case
    from soilml.identification.trained_estimator import for_simulated_case
    from soilml.io.read_table import read_table
    from soilml.io.text_tables import csv_text
    from soilml.onboard.estimator import Estimator
    from training.benchmark import user_report as report
    from training.benchmark.provenance import check_same_provenance
    from training.benchmark.user_comparison import compare

    if len(args.files) < 3 or not args.out:
        raise InputError("needed are MODEL.toml TEST.parquet MODEL.onnx ... --out DIR")
    model, test, *files = args.files
    case = read_case(model)
    table = read_table(test, ("run", "slip", "load_N", "torque_Nm"), filled=("run",))
    estimators = {Path(file).stem: for_simulated_case(Estimator.load(file), case) for file in files}
    _check_labels(estimators, files)
    names = next(iter(estimators.values())).names
    for note in check_same_provenance(case, table, estimators, names):
        print(note, file=sys.stderr)
    with made_folder(args.out) as folder:
        with stages() as progress:
            lines = compare(case, table, estimators, progress, args.analytic_sets)
        with replacing_all([folder / name for name in FILES]) as (rows, picture, page):
            rows.write_text(csv_text(report.columns(lines, names)), encoding="utf-8")
            report.draw(lines, names, picture)
            page.write_text(report.page(lines, names, Path(test).name), encoding="utf-8")
    print(report.table(lines, names))
    print(f"\n{folder}/compare.md, compare.csv, compare.png", file=sys.stderr)
    return 0
