"""`soilml adapt`: from a campaign to a file for the board that knows what the model lacked."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.option_values import whole_number_from
from soilml.cli.options import REQUIRED, InputFile, folder_outputs

DESCRIPTION = """\
Compare MODEL.toml with measured runs, add the effect that it lacks, train a
file for the board on the model with it, and judge that file on runs that were
kept back, beside one trained on the model as it was.

  soilml adapt MODEL.toml RUNS.csv --out FOLDER
  soilml adapt MODEL.toml RUNS.csv --out FOLDER --against exported/wheel.onnx

A quarter of the runs is kept back (--seed). From the torque of their first
rows each file estimates the soil, and its model predicts torque, drawbar pull
and sinkage of the later rows. The verdict comes first: by how much the error
falls, or why the old file stays. Of fewer than four runs none is kept back:
the file is then trained and not judged.

FOLDER receives report.html (start here), adapt.json, adapted.onnx with its
card adapted.md, adapted.c and adapted.h, adapted.toml (the model with the
effect), the recipes and rows of both files, before.onnx, campaign.csv and
kept_back.csv, and the files of `soilml gap` in FOLDER/gap.

The exit status is 0 also where the analysis supports no change, which is a
result, and 2 for bad input. --suspected adds the first suspect where the
evidence names no effect and `gap` predicts rows kept back better with it.
"""
#: Files of the folder, beside those of the folder `gap` in it.
FILES = (
    *("report.html", "adapt.json", "campaign.csv", "kept_back.csv", "adapted.toml"),
    *(f"adapted{end}" for end in (".onnx", ".md", ".c", ".h", "_recipe.toml", "_rows.parquet")),
    *(f"before{end}" for end in (".onnx", ".md", "_recipe.toml", "_rows.parquet")),
)
LEAST_ROWS, MOST_ROWS = 2000, 10**9  # Synthetic rows of a file
ARGUMENTS = (
    "model-and-runs",
    ("--out FOLDER", "folder for all files", REQUIRED),
    ("--suspected", "add the first suspect where the evidence names none, and it predicts better"),
    ("--against FILE.onnx", "file to compare with, in place of one trained anew", InputFile),
    ("--rows N (40000)", "of each file's training", whole_number_from(LEAST_ROWS, MOST_ROWS)),
    "seed",
    "workers",
    "ignore-extra",
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes, where their folder exists already."""
    return folder_outputs("--out", args.out, FILES)


def run(args: argparse.Namespace) -> int:
    """Adapt, judge, and write all files."""
    from soilml.optional_imports import need

    for library in ("jinja2", "matplotlib", "training.adaptation"):
        need(library, "adapt")
    from soilml.cli.output import origin_of, show_result, tell
    from soilml.cli.progress import stage_progress
    from soilml.cli.tables import print_table_hints, read_long_table
    from soilml.config.case import read_case
    from soilml.io.read_table import RUNS
    from training.adaptation import adapt

    case = read_case(args.model, with_bias=True)
    table = read_long_table(args.runs, RUNS, ignore_extra=args.ignore_extra)
    print_table_hints(table, case)
    with stage_progress() as progress:
        report = adapt(
            case,
            table,
            args.out,
            suspected=args.suspected,
            against=args.against,
            rows=args.rows,
            seed=args.seed,
            workers=args.workers,
            progress=progress,
            model_name=str(args.model),
            origin=origin_of(args),
        )
    show_result(report.report(), report.as_json())
    folder = Path(args.out)
    tell(f"\n{', '.join(str(folder / name) for name in ('report.html', *report.files))}")
    return 0
