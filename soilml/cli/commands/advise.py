"""`soilml plan next`: which measurement to make next."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from soilml.cli.option_values import SLIP, NumberFrom, whole_number_from
from soilml.cli.options import OutputFile, gravity_change
from soilml.errors import InputError

if TYPE_CHECKING:
    from soilml.config.case import Case
    from soilml.experiment_design import ParameterSamples
    from soilml.remarks import Remark

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
for each, the best repetition of a measured row, and the best sequence of
--count rows.

Candidate channels are those whose noise is declared in [noise]: torque alone,
and torque with each other channel. Without --load, loads from half to twice
the measured ones are tried.

With --gravity, rate tests made where --tested-at says (on Earth) by what they
reveal of the drawbar pull of the wheel there, under --target-load:

  soilml plan next MODEL.toml --gravity moon --target-load 20 --radius 0.1,0.15

A test has rows at all --slip under a load, with a wheel of a radius.
pull_left_N is the standard deviation of the pull that is expected after it,
with the law of gravity in doubt; scaled_error_N that of scaling by the loads,
without a model. speed_ratio is at equal Froude number.
"""
#: Largest number of rows planned in a sequence, and of operating points (slips times loads).
MAX_COUNT, MAX_POINTS = 5, 1000
MAX_TESTS = 200  # Most tests for another gravity
#: Columns of their table, and the attribute of a test in each.
TRANSFER = {
    "load_N": "load",
    "radius_m": "radius",
    "pull_left_N": "pull_std",
    "scaled_error_N": "scaled_error",
    "speed_ratio": "speed_ratio",
}
ARGUMENTS = (
    "model-and-any-runs",
    ("--slip S,...", "candidate slips: A,B,... or start:stop:count"),
    ("--load N,...", "candidate loads in N"),
    ("--count N", "rows of the planned sequence (default: 3)", whole_number_from(1, MAX_COUNT)),
    "free",
    ("--all", "list every candidate, best first"),
    "gravity",
    ("--target-load N", "of the wheel there (default: [rover])", NumberFrom(1e-3, 1e6, "N")),
    ("--target-slip S", "slip of the pull there (default: 0.3)", SLIP),
    ("--radius M,...", "further wheel radii of tests in m"),
    "effects",
    "exact-model",
    "rows",
    ("--out FILE.csv", "write the table to this file", OutputFile),
    ("--picture FILE.png", "draw maps of the expected width over slip and load", OutputFile),
)


def run(args: argparse.Namespace) -> int:
    """Rate all candidates and write the table."""
    import numpy as np

    from soilml.cli.option_values import parse_names, parse_numbers
    from soilml.cli.options import available_effects
    from soilml.cli.output import deliver, tell, write_columns
    from soilml.cli.progress import working
    from soilml.cli.tables import print_table_hints, read_case_of_rows, read_rows
    from soilml.experiment_design import advise, candidate_grid
    from soilml.experiment_design.next_rows import COUNT, known_soil, mean_covariates
    from soilml.experiment_design.presentation import (
        advice_columns,
        best_rows,
        next_row_remarks,
        report_of_advice,
    )
    from soilml.io.read_table import RUNS
    from soilml.remarks import Remark, texts

    if args.where is not None and args.runs is None:
        raise InputError("--where selects rows of RUNS.csv; give RUNS.csv too")
    if args.gravity is None:
        for option in ("target_load", "target_slip", "radius"):
            if getattr(args, option) is not None:
                raise InputError(f"--{option.replace('_', '-')} needs --gravity, such as moon")
    elif args.count is not None or args.picture is not None:
        raise InputError("--count and --picture are of rows; with --gravity omit them")
    table = None if args.runs is None else read_rows(args, RUNS)
    slips, loads = (
        None if text is None else parse_numbers(option, text).tolist()
        for option, text in (("--slip", args.slip), ("--load", args.load))
    )
    case = read_case_of_rows(args, args.model, table, available_effects(args), with_bias=False)
    change = gravity_change(args, case)
    if table is not None:
        print_table_hints(table, case)
    with working("taking the rows into account"):
        known = known_soil(case, table, parse_names(args.free), args.exact_model)
    case, at, samples, notes = known.case, known.measured, known.samples, list(known.notes)
    driven = known.loads
    if change is not None and loads is None:
        driven = np.ones(1)  # loads of tests follow from that of the target
    ranges = candidate_grid(slips, loads, driven)
    if len(ranges.slips) * len(ranges.loads) > MAX_POINTS:
        raise InputError(
            f"{len(ranges.slips)} slips times {len(ranges.loads)} loads are too many to try; "
            f"at most {MAX_POINTS} operating points are possible"
        )
    with working("rating the rows that could be next"):
        covariates = {} if at is None else mean_covariates(at)
        if change is not None:
            columns, found = _tests_elsewhere(
                args, case, samples, change=change, loads=loads, slips=slips, covariates=covariates
            )
            write_columns(columns, args.out)
            tell("\n".join(texts([*found, *notes])))
            return 0
        advice = advise(
            case, samples, ranges, measured=at, count=args.count or COUNT, covariates=covariates
        )
    remarks = [] if at is None else [*next_row_remarks(advice), *notes]
    if case.states_model_error:
        which = "[discrepancy]" if case.remainder is None else "error of the [remainder]"
        text = f"the {which} of a next row counts as independent of that of other rows: "
        remarks.append(Remark("independent-discrepancy", f"{text}repetitions are overrated"))
    if advice.excluded_points:
        text = (
            f"{advice.excluded_points} of {len(ranges.slips) * len(ranges.loads)} operating points "
            "are excluded: a twentieth or more of the posterior samples does not carry the wheel"
        )
        remarks.append(Remark("not-carried", text))
    report = report_of_advice(advice, at, remarks)
    rows = best_rows(advice)
    if args.all:
        rows = [("candidate", c) for c in sorted(advice.choices, key=lambda c: c.overall)]
    columns = advice_columns(advice, rows)
    deliver(args, report, columns=columns)
    return 0


def _tests_elsewhere(
    args: argparse.Namespace, case: Case, samples: ParameterSamples, **options: Any
) -> tuple[dict[str, Any], list[Remark]]:
    """Columns and remarks of tests that are rated for the pull under another gravity."""
    import numpy as np

    from soilml.cli.option_values import parse_numbers
    from soilml.experiment_design.transfer_tests import TARGET_SLIP, advise_transfer

    load = args.target_load
    if load is None:
        if case.rover is None:
            raise InputError("--gravity needs --target-load, the load of the wheel there in N")
        load = case.rover.mass * options["change"].target / len(case.rover.wheels)
    radii = None if args.radius is None else parse_numbers("--radius", args.radius).tolist()
    if len(options["loads"] or ()) * (1 + len(radii or ())) > MAX_TESTS:
        raise InputError(f"loads times radii are too many tests; at most {MAX_TESTS} are possible")
    slip = args.target_slip or TARGET_SLIP
    found = advise_transfer(case, samples, load=load, slip=slip, radii=radii, **options)
    rows = {"best by the model": found.best, "best by scaling": found.best_scaled}
    named = {"same load": found.same_load, "same mass": found.same_mass}
    rows |= {name: test for name, test in named.items() if test is not None}
    tests, names = list(rows.values()), list(rows)
    if args.all:
        tests = sorted(found.tests, key=lambda test: test.pull_std)
        names = ["candidate"] * len(tests)
    columns: dict[str, Any] = {"test": names}
    for key, name in TRANSFER.items():
        columns[key] = np.asarray([getattr(test, name) for test in tests])
    return columns, list(found.remarks())
