"""`soilml plan next`: which measurement to make next."""

from __future__ import annotations

import argparse

from soilml.cli.options import OutputFile
from soilml.errors import InputError

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Rank the operating points (slip, load) and sensors of a next measurement by how
much they reduce the uncertainty of the parameters that have a prior in
MODEL.toml.

  soilml plan next MODEL.toml RUNS.csv
  soilml plan next MODEL.toml RUNS.csv --slip 0.1,0.3,0.5 --load 30:120:4
  soilml plan next MODEL.toml --load 30:120:4 --picture map.png

<parameter>_left is the standard deviation that is expected after a row,
divided by that of the prior (1: nothing learned), over soils drawn as by
soilml identify. Rows are the best candidate for all parameters together and
for each.

Candidate channels are those whose noise is declared in [noise]: torque alone,
and torque with each other channel. Without --load, loads from half to twice
the measured ones are tried.
"""
ARGUMENTS = (
    "model-and-any-runs",
    ("--slip S,...", "candidate slips: A,B,... or start:stop:count"),
    ("--load N,...", "candidate loads in N"),
    "free",
    ("--all", "list every candidate, best first"),
    "effects",
    "exact-model",
    "rows",
    ("--out FILE.csv", "write the table to this file", OutputFile),
    ("--picture FILE.png", "draw maps of the expected width over slip and load", OutputFile),
)


def run(args: argparse.Namespace) -> int:
    """Rate all candidates and write the table."""
    from soilml.cli.option_values import parse_names, parse_numbers
    from soilml.cli.options import available_effects
    from soilml.cli.output import deliver
    from soilml.cli.progress import working
    from soilml.cli.tables import print_table_hints, read_case_of_rows, read_rows
    from soilml.experiment_design.next_rows import advise
    from soilml.io.read_table import RUNS

    if args.where is not None and args.runs is None:
        raise InputError("--where selects rows of RUNS.csv; give RUNS.csv too")
    table = None if args.runs is None else read_rows(args, RUNS)
    slips, loads = (
        None if text is None else parse_numbers(option, text).tolist()
        for option, text in (("--slip", args.slip), ("--load", args.load))
    )
    case = read_case_of_rows(args, args.model, table, available_effects(args), with_bias=False)
    if table is not None:
        print_table_hints(table, case)
    with working("rating the rows that could be next"):
        found = advise(
            case,
            table,
            free=parse_names(args.free),
            slips=slips,
            loads=loads,
            exact_model=args.exact_model,
        )
    columns = found.frame_columns() if args.all else found.best_columns()
    deliver(args, found.report(), columns=columns)
    return 0
