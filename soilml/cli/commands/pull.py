"""`soilml pull`: drawbar pull against slip and the slope that it climbs, with their bands."""

from __future__ import annotations

import argparse
import sys
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from soilml.cli.commands.identify import add_row_options, chosen_rows
from soilml.cli.commands.simulate import numbers
from soilml.cli.effects_option import add_effects_option, chosen_effects
from soilml.cli.output import put, watched
from soilml.config.case import read_case
from soilml.errors import FitError, InputError
from soilml.io.atomic_files import named, replacing_all
from soilml.io.read_table import RUNS
from soilml.io.text_tables import aligned, csv_text
from soilml.optional_imports import need

if TYPE_CHECKING:
    from soilml.traction.by_load import LoadPrediction
    from soilml.traction.pull_and_slope import QuantileBand
    from soilml.traction.report import PullReport

#: Every so many slips of the curve are printed; loads asked for at most.
SHOWN, MOST_LOADS = 2, 8
DEGREES = 180.0 / pi

HELP = "drawbar pull against slip, and the slope climbed, on the soil of measured rows"
DESCRIPTION = """\
How hard a gear pulls on the soil that the rows were driven on, at which slip, and what slope a
vehicle on such gears climbs, each with the band that the rows leave.

  soilml pull MODEL.toml RUNS.csv --picture pull.png
  soilml pull MODEL.toml RUNS.csv --load 80,120 --slip-limit 0.3 --out pull.csv
  soilml pull MODEL.toml RUNS.csv --from exported/wheel.onnx

RUNS.csv is that of `soilml identify`: run, slip, load_N, torque_Nm, and where measured
drawbar_pull_N, sinkage_m. Soils are drawn from the posterior of the rows (--free says of which
parameters), or with --from from the estimate of a trained file, and each is driven through the
model. All rows are taken for one soil; --by run answers for each run. Loads are those of the rows,
unless --load names others; slips run to 0.6, to the highest driven, or to --slip-limit. On a slope
a wheel carries the part of its load across the slope and pulls the part along it.

pull, p05, p95: middle and 90 % band; prior: the band before any row. What stands beside a warning
that it is not known is no more than the prior. No error of the model is in a band, no load
transfer, no side slope. The CSV has a row for each load and slip, in SI units.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", metavar="MODEL.toml")
    parser.add_argument("runs", metavar="RUNS.csv", help="measured rows, CSV or Parquet")
    parser.add_argument("--load", help="vertical loads, N: start:stop:count, or with commas")
    parser.add_argument("--slip-limit", type=float, metavar="S", help="highest slip allowed")
    parser.add_argument("--free", metavar="A,B,...", help="parameters that are not known")
    parser.add_argument(
        "--from", dest="trained", metavar="MODEL.onnx", help="soil by this file's estimate"
    )
    add_effects_option(parser)
    parser.add_argument("--by", metavar="run", help="one answer for each value of this column")
    add_row_options(parser)
    parser.add_argument("--out", metavar="FILE.csv", help="where to write the curves")
    parser.add_argument("--picture", metavar="FILE.png", help="where to draw the bands")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return [*named(args.out, ".csv"), *named(args.picture, ".png")]


def run(args: argparse.Namespace) -> int:
    """Predict and deliver."""
    from soilml.traction.report import pull_report

    _check(args)
    case = read_case(args.model, chosen_effects(args))
    table = chosen_rows(args, RUNS)
    options: dict[str, Any] = {
        "loads": None if args.load is None else numbers("--load", args.load).tolist(),
        "slip_limit": args.slip_limit,
        "free": None if args.free is None else [name.strip() for name in args.free.split(",")],
    }
    if len(options["loads"] or ()) > MOST_LOADS:
        raise InputError(f"--load names {len(options['loads'])} loads; at most {MOST_LOADS}")
    if args.trained is not None:
        need("onnxruntime", "pull")
        from soilml.onboard.estimator import Estimator

        options["estimator"] = Estimator.load(args.trained)
    found, failed = {}, {}
    for name, rows in [("", table)] if args.by is None else table.groups(args.by):
        try:
            found[name] = pull_report(case, rows, **options)
        except FitError as error:
            if args.by is None:
                raise
            failed[name] = str(error)
    if not found:
        name, why = next(iter(failed.items()))
        raise FitError(f"no {args.by} has an answer; {args.by} {name}: {why}")
    _deliver(args, found)
    for name, why in failed.items():
        print(f"{args.by} {name} has no answer: {why}", file=sys.stderr)
    return 0


def _check(args: argparse.Namespace) -> None:
    if args.slip_limit is not None and not 0.0 < args.slip_limit < 1.0:
        raise InputError(f"--slip-limit is {args.slip_limit:g}; needed is a slip between 0 and 1")
    if args.picture is not None:
        need("matplotlib", "pull --picture")
        if args.by is not None:
            raise InputError("--picture shows one soil; choose it with --where run=NAME, not --by")
    if args.trained is not None and args.free is not None:
        raise InputError("--free is for the posterior; a trained file has its own unknowns")


def _deliver(args: argparse.Namespace, found: dict[str, PullReport]) -> None:
    """Write the files, and show the answer to a person or give it to a program."""
    text = csv_text(_curves(args.by, found))
    with replacing_all(outputs(args)) as parts:
        for part in parts:
            if args.picture is not None and part == parts[-1]:
                from soilml.traction.plot import draw

                draw(found[""], part)
            else:
                part.write_text(text, encoding="utf-8")
    heads = {name: f"{args.by} {name}: " if args.by else "" for name in found}
    if args.out is None and not watched():
        put(text)
        for name, report in found.items():
            for line in _doubts(report):
                print(f"{heads[name]}{line}", file=sys.stderr)
    else:
        print("\n\n".join(heads[name] + _for_people(report) for name, report in found.items()))


def _curves(by: str | None, found: dict[str, PullReport]) -> dict[str, Any]:
    """A row for each group, load and slip; what holds for a load stands in all its rows."""
    parts = [
        ({by: np.full(len(one.known.slip), name)} if by else {}) | _columns(one)
        for name, report in found.items()
        for one in report.by_load
    ]
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def _columns(one: LoadPrediction) -> dict[str, Any]:
    from soilml.traction.pull_and_slope import quantile_band

    known, prior = one.known, one.prior
    count = len(known.slip)
    columns = {"load_N": np.full(count, known.load), "slip": known.slip}
    for name, values in (
        ("drawbar_pull_N", known.pull),
        ("slope_rad", known.slope),
        ("largest_drawbar_pull_N", known.largest_pull),
        ("best_slip", known.best_slip),
        ("steepest_slope_rad", known.steepest),
    ):
        found = quantile_band(values)
        for ending, part in zip(("", "_p05", "_p95"), _ends(found), strict=True):
            columns[name + ending] = np.broadcast_to(part, count)
    before = quantile_band(prior.pull), quantile_band(prior.slope)
    for name, found in zip(("drawbar_pull_N", "slope_rad"), before, strict=True):
        columns[f"{name}_prior_p05"], columns[f"{name}_prior_p95"] = found.lower, found.upper
    for name, share in zip(("largest_drawbar_pull", "steepest_slope"), one.left, strict=True):
        columns[f"{name}_left_of_prior"] = np.full(count, share)
    return columns


def _ends(found: QuantileBand) -> tuple[Any, Any, Any]:
    return found.middle, found.lower, found.upper


def _doubts(report: PullReport) -> list[str]:
    """Warnings of all loads and of the whole, each once."""
    own = [f"{one.known.load:.4g} N: {text}" for one in report.by_load for text in one.warnings]
    return [*own, *report.warnings]


def _for_people(report: PullReport) -> str:
    slips, loads = report.driven.slip, report.driven.load
    head = (
        f"{report.rows} row{'s'[: report.rows > 1]} at slips {slips[0]:.2g} to {slips[1]:.2g}, "
        f"loads {loads[0]:.4g} to {loads[1]:.4g} N"
    )
    parts = [head, *(_of_load(one) for one in report.by_load)]
    return "\n\n".join([*parts, "\n".join(f"! {text}" for text in report.warnings)])


def _of_load(one: LoadPrediction) -> str:
    from soilml.identification.diagnostics import NOT
    from soilml.traction.pull_and_slope import quantile_band

    known, prior = one.known, one.prior
    pull, slope, before = (
        quantile_band(known.pull),
        quantile_band(known.slope),
        quantile_band(prior.pull),
    )
    header = (
        "slip", "pull_N", "p05", "p95", "pull/load", "slope_deg", "p05", "p95",
        "prior_p05_N", "prior_p95_N",
    )  # fmt: skip
    lines = []
    for i in range(SHOWN - 1, len(known.slip), SHOWN):
        cells = [f"{known.slip[i]:.3g}", *(f"{v[i]:.1f}" for v in _ends(pull))]
        cells += [f"{pull.middle[i] / known.load:.2f}"]
        cells += [f"{DEGREES * v[i]:.1f}" for v in _ends(slope)]
        lines.append((*cells, f"{before.lower[i]:.1f}", f"{before.upper[i]:.1f}"))
    ends = quantile_band(known.best_slip), quantile_band(known.steepest_slip)
    pulled = _said(quantile_band(known.largest_pull), 1.0, one.left[0] > NOT)
    climbed = _said(quantile_band(known.steepest), DEGREES, one.left[1] > NOT)
    best = [
        f"largest pull    {pulled} N, at slip {_slips(ends[0])}; "
        f"before the rows {_range(quantile_band(prior.largest_pull), 1.0)} N",
        f"steepest slope  {climbed} deg, at slip {_slips(ends[1])}; "
        f"before the rows {_range(quantile_band(prior.steepest), DEGREES)} deg",
    ]
    doubts = [f"! {text}" for text in one.warnings]
    table = aligned(header, lines, text_columns=0)
    return "\n".join([f"load {known.load:.4g} N", table, *best, *doubts])


def _said(found: QuantileBand, factor: float, unknown: bool) -> str:
    middle = "not known" if unknown else f"{factor * float(found.middle):.1f}"
    return f"{middle} ({_range(found, factor)})"


def _range(found: QuantileBand, factor: float) -> str:
    return f"{factor * float(found.lower):.1f} to {factor * float(found.upper):.1f}"


def _slips(found: QuantileBand) -> str:
    low, middle, high = (f"{float(v):.2g}" for v in (found.lower, found.middle, found.upper))
    return middle if low == high else f"{middle} ({low} to {high})"
