"""`soilml pull`: drawbar pull against slip and the slope that can be climbed, with bands."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from math import pi
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from soilml.cli.option_values import available_effects, parse_names, parse_numbers, read_rows
from soilml.cli.output import is_terminal, write_stdout
from soilml.config.case import Case, read_case, read_case_of_one_gear
from soilml.config.wheeled_rover import read_gravity
from soilml.errors import FitError, InputError
from soilml.io.atomic_files import atomic_outputs
from soilml.io.read_table import RUNS
from soilml.io.table import Table
from soilml.io.text_tables import csv_text, format_table
from soilml.optional_imports import need

if TYPE_CHECKING:
    from soilml.numerics.quantile_band import QuantileBand
    from soilml.onboard.estimator import Estimator
    from soilml.traction.by_load import LoadPrediction
    from soilml.traction.report import PullReport

Report = TypeVar("Report")

#: The printed curve has every second slip; largest number of loads.
PRINTED_STEP, MAX_LOADS = 2, 8
DEGREES = 180.0 / pi


def run(args: argparse.Namespace) -> int:
    """Predict and write the results."""
    from soilml.traction.report import pull_report

    _check(args)
    table = read_rows(args, RUNS)
    if args.load is None and args.gear is None:
        whole = read_case(args.model, available_effects(args))
        if whole.rover is not None:
            return _run_rover(args, whole, table)
    for option in ("slope", "gravity"):
        if getattr(args, option) is not None:
            raise InputError(
                f"--{option} needs a model file with [rover], and neither --load nor --gear"
            )
    case = read_case_of_one_gear(args.model, available_effects(args), args.gear)
    options: dict[str, Any] = {
        "loads": None if args.load is None else parse_numbers("--load", args.load).tolist(),
        "slip_limit": args.slip_limit,
        "free": parse_names(args.free),
        "estimator": _estimator(args),
    }
    if len(options["loads"] or ()) > MAX_LOADS:
        raise InputError(f"--load names {len(options['loads'])} loads; at most {MAX_LOADS}")
    found, failed = _by_group(args, table, lambda rows: pull_report(case, rows, **options))
    _write(args, found)
    _tell_failed(args, failed)
    return 0


def _run_rover(args: argparse.Namespace, case: Case, table: Table) -> int:
    """The same for a whole rover."""
    from soilml.cli.rover_text import rover_columns, rover_text
    from soilml.traction.rover.report import rover_report, with_gravity

    if args.gravity is not None:
        case = with_gravity(case, read_gravity(args.gravity))
    slopes = None if args.slope is None else np.deg2rad(parse_numbers("--slope", args.slope))
    options: dict[str, Any] = {"slopes": slopes, "slip_limit": args.slip_limit}
    options |= {"free": parse_names(args.free), "estimator": _estimator(args)}
    found, failed = _by_group(args, table, lambda rows: rover_report(case, rows, **options))
    parts = [
        ({args.by: np.full(len(report.performance.slope), name)} if args.by else {})
        | rover_columns(report)
        for name, report in found.items()
    ]
    text = csv_text({key: np.concatenate([part[key] for part in parts]) for key in parts[0]})
    rover = case.rover
    assert rover is not None
    with atomic_outputs(args.outputs(args)) as files:
        for part in files:
            if args.picture is not None and part == files[-1]:
                from soilml.traction.rover.plot import save_figure

                save_figure(found[""], part)
            else:
                part.write_text(text, encoding="utf-8")
    heads = {name: f"{args.by} {name}: " if args.by else "" for name in found}
    if args.out is None and not is_terminal():
        write_stdout(text)
        for name, report in found.items():
            for line in report.warnings:
                print(f"{heads[name]}{line}", file=sys.stderr)
    else:
        print("\n\n".join(heads[name] + rover_text(rover, r) for name, r in found.items()))
    _tell_failed(args, failed)
    return 0


def _by_group(
    args: argparse.Namespace, table: Table, answer: Callable[[Table], Report]
) -> tuple[dict[str, Report], dict[str, str]]:
    """The answer for each group of --by that has one, and why the others have none."""
    found, failed = {}, {}
    for name, rows in [("", table)] if args.by is None else table.groups(args.by):
        try:
            found[name] = answer(rows)
        except FitError as error:
            if args.by is None:
                raise
            failed[name] = str(error)
    if not found:
        name, why = next(iter(failed.items()))
        raise FitError(f"no {args.by} has a result; {args.by} {name}: {why}")
    return found, failed


def _tell_failed(args: argparse.Namespace, failed: dict[str, str]) -> None:
    for name, why in failed.items():
        print(f"{args.by} {name} has no result: {why}", file=sys.stderr)


def _estimator(args: argparse.Namespace) -> Estimator | None:
    """The trained file of --from."""
    if args.trained is None:
        return None
    need("onnxruntime", "pull")
    from soilml.onboard.estimator import Estimator

    return Estimator.load(args.trained)


def _check(args: argparse.Namespace) -> None:
    if args.slip_limit is not None and not 0.0 < args.slip_limit < 1.0:
        raise InputError(f"--slip-limit is {args.slip_limit:g}; needed is a slip between 0 and 1")
    if args.picture is not None:
        need("matplotlib", "pull --picture")
        if args.by is not None:
            raise InputError(
                "--picture draws one soil; select it with --where run=NAME instead of --by"
            )
    if args.trained is not None and args.free is not None:
        raise InputError(
            "--free applies to the posterior; the parameters of --from are those of the model file"
        )


def _write(args: argparse.Namespace, found: dict[str, PullReport]) -> None:
    """Write the files, then text on a terminal or CSV into a pipe."""
    text = csv_text(_curves(args.by, found))
    with atomic_outputs(args.outputs(args)) as parts:
        for part in parts:
            if args.picture is not None and part == parts[-1]:
                from soilml.traction.plot import save_figure

                save_figure(found[""], part)
            else:
                part.write_text(text, encoding="utf-8")
    heads = {name: f"{args.by} {name}: " if args.by else "" for name in found}
    if args.out is None and not is_terminal():
        write_stdout(text)
        for name, report in found.items():
            for line in _warnings(report):
                print(f"{heads[name]}{line}", file=sys.stderr)
    else:
        print("\n\n".join(heads[name] + _text(report) for name, report in found.items()))


def _curves(by: str | None, found: dict[str, PullReport]) -> dict[str, Any]:
    """A row for each group, load and slip; what holds for a load stands in all its rows."""
    parts = [
        ({by: np.full(len(one.posterior.slip), name)} if by else {}) | _columns(one)
        for name, report in found.items()
        for one in report.by_load
    ]
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def _columns(one: LoadPrediction) -> dict[str, Any]:
    from soilml.numerics.quantile_band import quantile_band

    known, prior = one.posterior, one.prior
    count = len(known.slip)
    columns = {"load_N": np.full(count, known.load), "slip": known.slip}
    for name, values in (
        ("drawbar_pull_N", known.pull),
        ("slope_rad", known.slope),
        ("largest_drawbar_pull_N", known.largest_pull),
        ("best_slip", known.best_slip),
        ("steepest_slope_rad", known.steepest_slope),
    ):
        found = quantile_band(values)
        for ending, part in zip(("", "_p05", "_p95"), _ends(found), strict=True):
            columns[name + ending] = np.broadcast_to(part, count)
    before = quantile_band(prior.pull), quantile_band(prior.slope)
    for name, found in zip(("drawbar_pull_N", "slope_rad"), before, strict=True):
        columns[f"{name}_prior_p05"], columns[f"{name}_prior_p95"] = found.lower, found.upper
    for name, share in zip(
        ("largest_drawbar_pull", "steepest_slope"), one.remaining_fraction, strict=True
    ):
        columns[f"{name}_left_of_prior"] = np.full(count, share)
    return columns


def _ends(found: QuantileBand) -> tuple[Any, Any, Any]:
    return found.middle, found.lower, found.upper


def _warnings(report: PullReport) -> list[str]:
    """Warnings of each load, then those of the whole result."""
    own = [f"{one.posterior.load:.4g} N: {text}" for one in report.by_load for text in one.warnings]
    return [*own, *report.warnings]


def _text(report: PullReport) -> str:
    slips, loads = report.measured_range.slip, report.measured_range.load
    head = (
        f"{report.rows} row{'s'[: report.rows > 1]} at slips {slips[0]:.2g} to {slips[1]:.2g}, "
        f"loads {loads[0]:.4g} to {loads[1]:.4g} N"
    )
    parts = [head, *(_load_text(one) for one in report.by_load)]
    return "\n\n".join([*parts, "\n".join(f"! {text}" for text in report.warnings)])


def _load_text(one: LoadPrediction) -> str:
    from soilml.numerics.quantile_band import quantile_band
    from soilml.quantities import NOT_IDENTIFIED_ABOVE

    known, prior = one.posterior, one.prior
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
    for i in range(PRINTED_STEP - 1, len(known.slip), PRINTED_STEP):
        cells = [f"{known.slip[i]:.3g}", *(f"{v[i]:.1f}" for v in _ends(pull))]
        cells += [f"{pull.middle[i] / known.load:.2f}"]
        cells += [f"{DEGREES * v[i]:.1f}" for v in _ends(slope)]
        lines.append((*cells, f"{before.lower[i]:.1f}", f"{before.upper[i]:.1f}"))
    ends = quantile_band(known.best_slip), quantile_band(known.steepest_slip)
    pulled = _value_text(
        quantile_band(known.largest_pull), 1.0, one.remaining_fraction[0] > NOT_IDENTIFIED_ABOVE
    )
    climbed = _value_text(
        quantile_band(known.steepest_slope),
        DEGREES,
        one.remaining_fraction[1] > NOT_IDENTIFIED_ABOVE,
    )
    best = [
        f"largest pull    {pulled} N, at slip {_slips(ends[0])}; "
        f"before the rows {_range(quantile_band(prior.largest_pull), 1.0)} N",
        f"steepest slope  {climbed} deg, at slip {_slips(ends[1])}; "
        f"before the rows {_range(quantile_band(prior.steepest_slope), DEGREES)} deg",
    ]
    doubts = [f"! {text}" for text in one.warnings]
    table = format_table(header, lines, text_columns=0)
    return "\n".join([f"load {known.load:.4g} N", table, *best, *doubts])


def _value_text(found: QuantileBand, factor: float, unknown: bool) -> str:
    middle = "not known" if unknown else f"{factor * float(found.middle):.1f}"
    return f"{middle} ({_range(found, factor)})"


def _range(found: QuantileBand, factor: float) -> str:
    return f"{factor * float(found.lower):.1f} to {factor * float(found.upper):.1f}"


def _slips(found: QuantileBand) -> str:
    low, middle, high = (f"{float(v):.2g}" for v in (found.lower, found.middle, found.upper))
    return middle if low == high else f"{middle} ({low} to {high})"
