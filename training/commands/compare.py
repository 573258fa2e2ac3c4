"""`soilml compare`: model files against analytic identification and the prior."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from soilml.cli.option_values import whole_number_from
from soilml.cli.options import ANY, InputFile
from soilml.errors import InputError
from soilml.io.atomic_files import create_folder, output_files

if TYPE_CHECKING:
    from soilml.report.report import Report

#: Outputs of a comparison on the user's test data, and of the benchmark.
FILES = ("report.html", "compare.json", "compare.csv", "compare.png")
BENCHMARK = ("report.html", "benchmark.json", "benchmark.csv", "benchmark.png")
#: Output folder of the benchmark without --out, and its model files without arguments.
FOLDER = "demo/benchmark"
RELEASED = ("wheel", "wheel_lssvm", "wheel_mlp", "wheel_linear", "any_wheel")

DESCRIPTION = """\
Score model files, analytic identification and the prior on sets of readings
whose soil is known: RMSE, coverage of 50 and 90 % intervals, failures, and
time per estimate.

1. On the fixed benchmark

     soilml compare
     soilml compare mine.onnx other.onnx --sets 50 --out comparison

   Sets of 1 to 18 rows at one load and at three loads, simulated from the
   packaged recipe `benchmark`. RMSE is also given relative to the Bayes limit:
   the exact posterior mean of the same sets, which no estimator can beat on
   average. Without a model file, the released files are scored (in a clone of
   the repository). Writes report.html (start here), benchmark.json,
   benchmark.csv and benchmark.png.

2. On test data of your own

     soilml compare MODEL.toml TEST.parquet wheel.onnx other.onnx --out FOLDER

   TEST.parquet comes from `soilml generate`, with a seed that was not used in
   training. Its runs are the sets; single rows are scored too. MODEL.toml
   gives the analytic methods their wheel, soil, priors and noise, which must
   equal those of the test data. Writes report.html (start here),
   compare.json, compare.csv and compare.png.

3. To recompute the Bayes limit of the benchmark (minutes, on all cores)

     soilml compare --limit limit.parquet
"""


ARGUMENTS = (
    ("files FILE", "MODEL.onnx ..., or MODEL.toml TEST.parquet MODEL.onnx ...", InputFile, ANY),
    ("--out FOLDER", f"output folder (default for the benchmark: {FOLDER})"),
    ("--sets N", "use only the first N sets of each size", whole_number_from(1)),
    ("--limit FILE.parquet", "compute the Bayes limit of the benchmark into this file alone"),
    ("--bayes-limit FILE.parquet", "a file of --limit (default: the packaged one)", InputFile),
    ("--analytic-sets N", "own data: sets of each size for analytic methods", whole_number_from(1)),
    "workers",
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes, where their folder exists already."""
    if args.limit is not None:
        return output_files(args.limit, ".parquet")
    folder = Path(args.out or FOLDER)
    names = FILES if _has_test_data(args) else BENCHMARK
    return [folder / name for name in names] if folder.is_dir() else []


def _has_test_data(args: argparse.Namespace) -> bool:
    """Whether a file other than a model file is given: model files alone are for the benchmark."""
    return any(Path(file).suffix.lower() != ".onnx" for file in args.files)


def run(args: argparse.Namespace) -> int:
    """Compare and write the results."""
    from soilml.optional_imports import need

    need("training.benchmark.suite", "compare")
    from soilml.processes import limited_workers

    with limited_workers(args.workers):
        if args.limit is not None:
            return _compute_limit(args)
        return _compare_on_test_data(args) if _has_test_data(args) else _run_benchmark(args)


def _run_benchmark(args: argparse.Namespace) -> int:
    from datagen.recipe import read_recipe
    from soilml.cli.output import show_result, tell
    from soilml.cli.progress import stage_progress
    from soilml.identification.trained_estimator import for_simulated_case
    from soilml.io.table import Table
    from soilml.onboard.estimator import Estimator
    from soilml.quantities import SHEAR
    from training.benchmark import report
    from training.benchmark.acceptance import goals
    from training.benchmark.suite import RECIPE, benchmark
    from training.benchmark.user_comparison import check_same_provenance

    files = [Path(file) for file in args.files] or _released_files()
    case = read_recipe(RECIPE).case
    estimators = {file.stem: for_simulated_case(Estimator.load(file), case) for file in files}
    _check_labels(estimators, files)
    for note in check_same_provenance(case, Table({}, f"recipe {RECIPE}"), estimators, SHEAR):
        tell(note.text)
    with create_folder(args.out or FOLDER) as folder, stage_progress() as progress:
        results = benchmark(estimators, None, args.sets, args.bayes_limit, progress)
        progress("drawing the report", 0, 1)
        columns = report.csv_columns(results)
        found = goals(results)
        content = {"columns": columns, "goals": [vars(goal) for goal in found]}
        page = report.benchmark_report(results)
        _write(
            args=args,
            folder=folder,
            names=BENCHMARK,
            page=page,
            content=content,
            read=files,
        )
    show_result(page, content)
    _say_where(folder, BENCHMARK)
    return 0


def _write(
    args: argparse.Namespace,
    folder: Path,
    names: Sequence[str],
    page: Report,
    content: Mapping[str, Any],
    read: Sequence[Path],
) -> None:
    """Write page, JSON, CSV and picture as one set; `read` are the model files."""
    from soilml.cli.output import origin_of
    from soilml.io.atomic_files import write_files
    from soilml.io.text_tables import csv_text
    from soilml.report.page import report_texts

    origin = origin_of(args, [str(path) for path in read])
    files = report_texts(page, origin, content, (names[0], names[1]), folder)
    files |= {folder / names[2]: csv_text(content["columns"])}
    files |= {folder / names[3]: page.pictures[0].save}
    write_files(files)


def _say_where(folder: Path, names: Sequence[str]) -> None:
    from soilml.cli.output import tell

    tell(f"\nmore columns are in {names[0]} and {names[2]}; written: {folder}/{', '.join(names)}")


def _released_files() -> list[Path]:
    """The model files that the repository comes with."""
    files = [Path("exported") / f"{name}.onnx" for name in RELEASED]
    missing = [file for file in files if not file.is_file()]
    if missing:
        raise InputError(
            f"no model file given, and {missing[0]} does not exist here: run it in a clone of the "
            "repository, or give one or more MODEL.onnx"
        )
    return files


def _compute_limit(args: argparse.Namespace) -> int:
    from datagen.recipe import read_recipe
    from soilml.cli.output import tell
    from soilml.cli.progress import stage_progress
    from soilml.quantities import SHEAR
    from training.benchmark.bayes_limit import benchmark_sets, compute_posteriors
    from training.benchmark.bayes_limit_file import save_limit
    from training.benchmark.suite import RECIPE

    if args.files or args.out or args.bayes_limit:
        raise InputError(
            "--limit given with other arguments; it allows --sets alone: omit the rest"
        )
    sets = benchmark_sets(read_recipe(RECIPE), SHEAR, args.sets)
    with stage_progress() as progress:
        summaries = list(compute_posteriors(sets, progress))
    save_limit(args.limit, sets, summaries)
    tell(f"written: {args.limit}, the Bayes limit of {len(sets)} sets")
    return 0


def _check_labels(estimators: Mapping[str, object], files: Sequence[object]) -> None:
    if len(estimators) != len(files):
        raise InputError("two model files have the same name, which labels their rows: rename one")


def _compare_on_test_data(args: argparse.Namespace) -> int:
    from soilml.cli.output import show_result, tell
    from soilml.cli.progress import stage_progress
    from soilml.cli.tables import read_long_table
    from soilml.config.case import read_case_of_one_gear
    from soilml.identification.trained_estimator import for_simulated_case
    from soilml.onboard.estimator import Estimator
    from training.benchmark import user_report as report
    from training.benchmark.user_comparison import check_same_provenance, compare

    if len(args.files) < 3 or not args.out:
        raise InputError("needed are MODEL.toml TEST.parquet MODEL.onnx ... --out FOLDER")
    model, test, *files = args.files
    case = read_case_of_one_gear(model)
    table = read_long_table(test, ("run", "slip", "load_N", "torque_Nm"), filled=("run",))
    estimators = {Path(file).stem: for_simulated_case(Estimator.load(file), case) for file in files}
    _check_labels(estimators, files)
    names = next(iter(estimators.values())).names
    for note in check_same_provenance(case, table, estimators, names):
        tell(note.text)
    with create_folder(args.out) as folder, stage_progress() as progress:
        scores = compare(case, table, estimators, progress, args.analytic_sets)
        progress("drawing the report", 0, 1)
        content = {"columns": report.csv_columns(scores, names)}
        page = report.comparison_report(scores, names, Path(test).name)
        _write(args=args, folder=folder, names=FILES, page=page, content=content, read=[])
    show_result(page, content)
    _say_where(folder, FILES)
    return 0
