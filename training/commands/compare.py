"""`soilml compare`: model files against analytic identification and the prior."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.option_values import whole_number_from
from soilml.cli.options import ANY, InputFile, folder_outputs
from soilml.errors import InputError

FILES = ("report.html", "compare.json", "compare.csv", "compare.png")
#: Output folder of the benchmark without --out, and its recipe and model files.
FOLDER, RECIPE = "demo/benchmark", "benchmark"
RELEASED = ("wheel", "wheel_lssvm", "wheel_mlp", "wheel_linear", "any_wheel")

DESCRIPTION = """\
Score model files, analytic identification and the prior on sets of readings
whose soil is known: RMSE, coverage of 90 % intervals, failures, and
time per estimate. RMSE is also given relative to the Bayes limit: the exact
posterior mean of the same sets, which no estimator can beat on average.

1. On the fixed benchmark

     soilml compare
     soilml compare mine.onnx other.onnx --sets 50 --out comparison

   Sets of 1 to 18 rows at one load and at three loads, simulated from the
   packaged recipe `benchmark`. Without a model file, the released files are
   scored.

2. On test data of your own

     soilml compare MODEL.toml TEST.parquet wheel.onnx other.onnx --out FOLDER

   TEST.parquet comes from `soilml generate`, with a seed that was not used in
   training. Its runs are the sets; single rows are scored too. MODEL.toml
   gives the analytic methods their wheel, soil, priors and noise, which must
   equal those of the test data.

Writes report.html (start here), compare.json, compare.csv and compare.png.
"""
ARGUMENTS = (
    ("files FILE", "MODEL.onnx ..., or MODEL.toml TEST.parquet MODEL.onnx ...", InputFile, ANY),
    ("--out FOLDER", f"output folder (default for the benchmark: {FOLDER})"),
    ("--sets N", "use only the first N sets of each size", whole_number_from(1)),
    "workers",
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes, where their folder exists already."""
    return folder_outputs("--out", args.out or FOLDER, FILES)


def run(args: argparse.Namespace) -> int:
    """Compare and write the results."""
    from soilml.optional_imports import need

    need("training.benchmark.comparison", "compare")
    from datagen.recipe import read_recipe
    from soilml.cli.output import origin_of, show_result, tell
    from soilml.cli.progress import stage_progress
    from soilml.cli.tables import read_long_table
    from soilml.config.case import read_case_of_one_gear
    from soilml.identification.trained_estimator import for_simulated_case
    from soilml.io.atomic_files import create_folder, write_files
    from soilml.io.table import Table
    from soilml.io.text_tables import csv_text
    from soilml.onboard.estimator import Estimator
    from soilml.processes import limited_workers
    from soilml.report.page import report_texts
    from training.benchmark.comparison import (
        MAX_SETS,
        check_same_provenance,
        compare,
        sets_of_recipe,
        sets_of_table,
    )
    from training.benchmark.report import comparison_report, csv_columns

    own_data = any(Path(file).suffix.lower() != ".onnx" for file in args.files)
    if own_data and (len(args.files) < 3 or not args.out):
        raise InputError("needed are MODEL.toml TEST.parquet MODEL.onnx ... --out FOLDER")
    files = args.files[2:] if own_data else args.files or RELEASED
    if own_data:
        case, test = read_case_of_one_gear(args.files[0]), Path(args.files[1]).name
        table = read_long_table(
            args.files[1], ("run", "slip", "load_N", "torque_Nm"), filled=("run",)
        )
    else:
        recipe = read_recipe(RECIPE)
        case, test, table = recipe.case, "the fixed benchmark", Table({}, f"recipe {RECIPE}")
    estimators = {Path(file).stem: for_simulated_case(Estimator.load(file), case) for file in files}
    if len(estimators) != len(files):
        raise InputError("two model files have the same name, which labels their rows: rename one")
    names = next(iter(estimators.values())).names
    for note in check_same_provenance(case, table, estimators, names):
        tell(note.text)
    out = args.out or FOLDER
    with create_folder(out) as folder, stage_progress() as progress, limited_workers(args.workers):
        sets = sets_of_table(table, names) if own_data else sets_of_recipe(recipe)
        results = compare(case, sets, estimators, progress, args.sets or MAX_SETS)
        progress("drawing the report", 0, 1)
        content = {"columns": csv_columns(results, names)}
        page = comparison_report(results, names, test)
        origin = origin_of(args, [str(file) for file in files])
        texts = report_texts(page, origin, content, (FILES[0], FILES[1]), folder)
        texts |= {folder / FILES[2]: csv_text(content["columns"])}
        write_files(texts | {folder / FILES[3]: page.pictures[0].save})
    show_result(page, content)
    tell(f"\nmore columns are in {FILES[0]} and {FILES[2]}; written: {folder}/{', '.join(FILES)}")
    return 0
