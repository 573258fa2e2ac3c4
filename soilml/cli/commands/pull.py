"""`soilml pull`: drawbar pull against slip and the slope that can be climbed, with bands."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from soilml.cli.option_values import SLIP
from soilml.cli.options import OutputFile, gravity_change
from soilml.errors import InputError

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Predict the drawbar pull of a running gear against slip on the soil of the
measured rows, the steepest slope of a vehicle with such gears, and the slip,
margin and work that slopes need, with 90 % bands.

  soilml pull MODEL.toml RUNS.csv --load 80,120 --slip-limit 0.3 --out pull.csv
  soilml pull ROVER.toml RUNS.csv --slope 0,10,15 --gravity moon
  soilml pull MODEL.toml RUNS.csv --load 20 --gravity 1.62 --tested-at 9.81

RUNS.csv is that of `soilml identify`. Soil, effects that the model may lack
and its smooth error are drawn from one posterior given the rows. All rows are
assumed to come from one soil, unless --by run asks for a result for each run.

Loads are those of the rows, unless --load names others; slips reach 0.6, the
highest measured slip, or --slip-limit. The bands include errors of the model,
but neither load transfer nor side slopes.

A model file with [rover] answers for the whole rover, unless --load or --gear
names one wheel.

--gravity predicts for another gravity than that of the rows. How a soil
changes with it is disputed: by default the law is open, and in the bands.

p05 and p95 are the ends of the 90 % band; `prior` is the band before any
measurement. The CSV file has a row for each load and slip, with columns for
each slope; of a rover a row for each slope. All are in SI units.
"""
MAX_LOADS = 8  # Largest number of loads
ARGUMENTS = (
    "model-and-runs",
    ("--load N,...", "vertical loads in N: A,B,... or start:stop:count"),
    ("--slope DEG,...", "slopes in degrees (default: 0,5,10,15,20)"),
    "gravity",
    ("--slip-limit S", "largest slip considered", SLIP),
    "free",
    "effects",
    "by",
    "rows",
    "exact-model",
    ("--out FILE.csv", "write the curves to this file", OutputFile),
    ("--picture FILE.png", "draw the curves and bands", OutputFile),
    "report",
)


def run(args: argparse.Namespace) -> int:
    """Predict and write the results."""
    import numpy as np

    from soilml.cli.option_values import parse_names, parse_numbers
    from soilml.cli.options import available_effects
    from soilml.cli.output import deliver
    from soilml.cli.tables import (
        print_table_hints,
        read_case_of_rows,
        read_rows,
        result_by_group,
        tell_failures,
    )
    from soilml.config.case import read_case
    from soilml.io.read_table import RUNS
    from soilml.report.report import by_group
    from soilml.traction import pull_report

    if args.picture is not None and args.by is not None:
        raise InputError(
            "--picture draws one soil; select it with --where run=NAME instead of --by"
        )
    table = read_rows(args, RUNS)
    loads = None if args.load is None else parse_numbers("--load", args.load).tolist()
    if len(loads or ()) > MAX_LOADS:
        raise InputError(f"--load names {len(loads or ())} loads; at most {MAX_LOADS}")
    effects = available_effects(args)
    case = read_case(args.model, effects, with_bias=True, with_explanations=True)
    gravity = gravity_change(args, case)
    if case.rover is None or args.load is not None or args.gear is not None:
        case = read_case_of_rows(args, args.model, table, effects, with_explanations=True)
        case = replace(case, rover=None)  # one of its wheels
    print_table_hints(table, case)
    options: dict[str, Any] = {
        "free": parse_names(args.free),
        "loads": loads,
        "slopes": None if args.slope is None else np.deg2rad(parse_numbers("--slope", args.slope)),
        "slip_limit": args.slip_limit,
        "exact_model": args.exact_model,
        "gravity": gravity,
    }
    found, failed = result_by_group(
        args, table, "predicting", lambda rows: pull_report(case, rows, **options)
    )
    parts: list[dict[str, Any]] = []
    for name, one in found.items():
        own = one.frame_columns()
        count = len(next(iter(own.values())))
        parts.append(({args.by: np.full(count, name)} if args.by else {}) | dict(own))
    columns = {key: np.concatenate([np.asarray(p[key]) for p in parts]) for key in parts[0]}
    reports = {name: one.report() for name, one in found.items()}
    title = f"Pull on the soil of {Path(args.runs).name}, by the model {Path(args.model).name}"
    if args.by is None:
        report = replace(reports[""], title=title)
    else:
        verdict = f"{len(found)} groups of rows have a prediction."
        if len(found) == 1:
            verdict = "One group of rows has a prediction."
        report = by_group(reports, failed, args.by, verdict, title)
    content = {
        "columns": {name: values.tolist() for name, values in columns.items()},
        "warnings": {n: [remark.as_json() for remark in r.remarks] for n, r in reports.items()},
        "failed": dict(failed),
    }
    deliver(args, report, content, columns)
    tell_failures(args.by, failed)
    return 0
