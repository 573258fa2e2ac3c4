"""`soilml estimate`: a trained model on measured rows, as on board."""

from __future__ import annotations

import argparse
import sys
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.cli.advice_text import after_estimate, typical, vaguest
from soilml.cli.commands.identify import add_row_options, chosen_rows
from soilml.cli.joint_readings import channels_said, joint_readings, row_readings
from soilml.cli.output import deliver
from soilml.cli.wheel_check import check_same_wheel, for_the_case
from soilml.errors import InputError, TableError
from soilml.experiment_design import is_identified
from soilml.io.atomic_files import named
from soilml.io.read_table import FILLED, RUNS
from soilml.io.table import Table
from soilml.numerics.estimate_fusion import COVARIANCE_INTERSECTION
from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import Estimator
from soilml.onboard.gaussian_pooling import LEAST_SOUND
from soilml.onboard.multi_sensor import ACROSS_FILES, PRIOR_ONCE, fused_estimates
from soilml.optional_imports import need
from soilml.quantities import column

HELP = "soil parameters or slip from measured rows, by a trained model file"
DESCRIPTION = """\
Estimate soil parameters, or slip, with MODEL.onnx, just as the onboard runtime does.

  soilml estimate exported/wheel.onnx RUNS.csv --out estimates.csv
  soilml estimate exported/wheel.onnx RUNS.csv --by run
  soilml estimate exported/any_wheel.onnx RUNS.csv --case MODEL.toml --by run
  soilml estimate slip_torque.onnx RUNS.csv --with slip_vibration.onnx

Each row gets a mean, a standard deviation and a 90 % interval (_p05, _p95) of every parameter, and
in_range: 0 where the readings are unlike anything that the model was trained on; the answer is then
the prior. One row brings one equation for three unknowns, so its estimate is mostly the prior; with
--by run, all rows of a run answer together, which can say far more, and sinkage_m, drawbar_pull_N
and <column>_std take part where the table has them; rows that no soil explains together, or of
which more than a tenth is out of range, give the prior. A row with a blank reading gets a blank
estimate, and so does one whose status is not ok. --with fuses files that estimate the same from
other sensors, row by row, and needs errors that are independent: files that read the same are
refused but for --rule covariance-intersection. A file whose reading is blank, or out of range,
takes no part, and `files` says how many did. Slip differs from row to row: no --by. What rows do
not tell is said on standard error, with the next row that would. Needs numpy and onnxruntime alone.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", metavar="MODEL.onnx")
    parser.add_argument("runs", metavar="RUNS.csv", help="measured rows, CSV or Parquet")
    parser.add_argument("--by", metavar="run", help="one estimate for each value of this column")
    parser.add_argument(
        "--with", dest="others", metavar="OTHER.onnx", action="append", default=[], help="fuse with"
    )
    parser.add_argument("--rule", help=f"how --with fuses: {', '.join(ACROSS_FILES)}")
    parser.add_argument("--case", metavar="MODEL.toml", help="your wheel, for any_wheel.onnx")
    add_row_options(parser)
    parser.add_argument("--out", metavar="FILE.csv", help="where to write the estimates")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return named(args.out, ".csv")


def run(args: argparse.Namespace) -> int:
    """Estimate and deliver the table."""
    need("onnxruntime", "estimate")
    estimators = [Estimator.load(file) for file in (args.model, *args.others)]
    _check_asked(args, estimators)
    estimators[0], said_first = for_the_case(args, estimators[0])
    read = {name: column(name) for estimator in estimators for name in estimator.inputs}
    needed = tuple(key for key in RUNS if key in ("run", *read.values()))
    filled = [key for key in FILLED if key in needed]
    table = chosen_rows(args, (*needed, *sorted({*read.values()} - {*needed})), filled)
    for estimator in estimators:
        check_same_wheel(estimator, table)
    each = [_measured(estimator, table) & table.answered for estimator in estimators]
    measured = np.any([_measured(estimator, table) for estimator in estimators], axis=0)
    if not np.any(each):
        wanted = ", ".join(column(n) for n in estimators[0].inputs)
        raise TableError(f"{table.source}: no row has all that this model reads: {wanted}")
    if args.by is None:
        columns, said = _row_by_row(estimators, table, each, args.rule or PRIOR_ONCE)
    else:
        columns, said = _by(estimators[0], table, each[0], args.by)
    deliver(columns, args.out)
    said = said_first + said
    said += _left_out(table, ~measured, "lack a reading")
    said += _left_out(table, measured & ~table.answered, "have a status that is not ok")
    print("\n".join(said), file=sys.stderr)
    return 0


def _left_out(table: Table, rows: NDArray[np.bool_], why: str) -> list[str]:
    """How many rows get no estimate, why, and where the first of them stand."""
    if not rows.any():
        return []
    some = ", ".join(str(table.place(int(i))) for i in np.flatnonzero(rows)[:3])
    more = ", ..." if rows.sum() > 3 else ""
    return [f"{int(rows.sum())} rows {why} and get no estimate: {some}{more}"]


def _check_asked(args: argparse.Namespace, estimators: list[Estimator]) -> None:
    """Raise `InputError` where the options do not go together."""
    if args.rule is not None and not args.others:
        raise InputError("--rule says how --with fuses; give --with OTHER.onnx")
    if args.by is not None and args.others:
        raise InputError("--with fuses row by row; leave out --by")
    if args.rule != COVARIANCE_INTERSECTION:
        _check_independent(args, estimators)
    if args.by is not None and estimators[0].per_row:
        raise InputError(
            f"{args.model} estimates {estimators[0].per_row[0]}, which differs from row to row of "
            "a run; leave out --by"
        )


def _check_independent(args: argparse.Namespace, estimators: list[Estimator]) -> None:
    """Raise `InputError` where one file reads nothing but what another reads: they err alike."""
    files = list(zip((args.model, *args.others), estimators, strict=True))
    for (one, first), (other, second) in combinations(files, 2):
        shared = set(first.inputs) & set(second.inputs)
        if len(shared) == min(len(first.inputs), len(second.inputs)):
            names = ", ".join(column(name) for name in first.inputs if name in shared)
            raise InputError(
                f"{one} and {other} both read {names}: their errors are not independent; take one "
                f"of them, or --rule {COVARIANCE_INTERSECTION}"
            )


def _measured(estimator: Estimator, table: Table) -> NDArray[np.bool_]:
    """Rows that have all that the model reads."""
    return np.asarray(np.all([np.isfinite(table[column(n)]) for n in estimator.inputs], axis=0))


def _row_by_row(
    estimators: list[Estimator], table: Table, each: list[NDArray[np.bool_]], rule: str
) -> tuple[dict[str, Any], list[str]]:
    """A line for every row; blank where no model has all that it reads."""
    estimates = [_of_rows(*parts, table) for parts in zip(estimators, each, strict=True)]
    whole = np.any(each, axis=0)
    inputs = dict.fromkeys(name for estimator in estimators for name in estimator.inputs)
    columns: dict[str, Any] = {"run": table["run"]}
    columns |= {column(name): table[column(name)] for name in inputs}
    estimate, files = estimates[0], None
    if len(estimators) > 1:
        combined = fused_estimates(estimates, rule)
        estimate, files = combined.estimate, combined.used.sum(axis=0)
    for key, values in _answers(estimate).items():
        columns[key] = np.where(whole, values, np.nan)
    columns["in_range"] = whole & estimate.in_range
    hint = "join rows with --by run"
    if files is not None:
        columns["files"] = files
    if estimators[0].per_row:
        hint = "measure with other sensors too, or train for soil that is better known,"
    said = _worth(estimate, "one row alone", "does", hint)
    if files is None and estimate.in_range.any():
        row = typical(estimate)
        readings = row_readings(estimators[0], table.rows(np.asarray([row])))
        lines = after_estimate(
            estimators[0], estimate.mean[row], estimate.covariance[row], readings
        )
        said += [f"after {table.place(row)} alone, a typical row: {line}" for line in lines[-1:]]
    outside = int(np.count_nonzero(whole & ~estimate.in_range))
    if outside:
        said.append(
            f"{outside} of {int(whole.sum())} rows are out of range: theirs is the prior"
            if files is None
            else f"{outside} of {int(whole.sum())} rows are out of range, or the files contradict "
            "each other there: theirs is the prior"
        )
    return columns, said


def _of_rows(estimator: Estimator, whole: NDArray[np.bool_], table: Table) -> Estimate:
    """An estimate for every row: out of range where it is not whole."""
    found = estimator.unknown(len(table))
    if whole.any():
        alone = estimator.sets is not None and estimator.sets.alone
        readings = (joint_readings if alone else row_readings)(estimator, table.rows(whole))
        estimate = estimator(**readings)
        for key in ("mean", "std", "covariance", "low", "high", "in_range"):
            getattr(found, key)[whole] = getattr(estimate, key)
    return found


def _by(
    estimator: Estimator, table: Table, whole: NDArray[np.bool_], by: str
) -> tuple[dict[str, Any], list[str]]:
    """A line for every value of a column, from all its rows together; blank where none is whole."""
    order = [name for name, _ in table.groups(by)]
    groups = list(table.rows(whole).groups(by))
    readings = [joint_readings(estimator, rows) for _, rows in groups]
    estimates = [estimator.run(**those) for those in readings]
    sound = [int(estimator.inside(**those).sum()) for those in readings]
    estimate = _stacked(estimates)
    place = {name: i for i, (name, _) in enumerate(groups)}
    there = np.asarray([name in place for name in order])
    index = np.asarray([place.get(name, 0) for name in order])
    counts = np.asarray([len(rows) for _, rows in groups])
    columns: dict[str, Any] = {
        by: np.asarray(order),
        "rows": np.where(there, counts[index], 0),
        "rows_in_range": np.where(there, np.asarray(sound)[index], 0),
    }
    for key, values in _answers(estimate).items():
        columns[key] = np.where(there, values[index], np.nan)
    columns["in_range"] = there & estimate.in_range[index]
    said = channels_said(estimator, joint_readings(estimator, table.rows(whole)))
    said += _worth(estimate, f"all rows of a {by}", "do", "drive other loads and slips")
    if estimate.in_range.any():
        name, rows = groups[i := vaguest(estimate)]
        lines = after_estimate(
            estimator, estimate.mean[i], estimate.covariance[i], row_readings(estimator, rows)
        )
        said += [f"{by} {name}: {line}" for line in lines]
    for (name, rows), good, one in zip(groups, sound, estimates, strict=True):
        if not one.in_range:
            why = f"{len(rows) - good} of {len(rows)} rows are out of range"
            if good >= LEAST_SOUND * len(rows):
                why = "no soil that the file knows explains its rows together"
            said.append(f"{by} {name}: {why}; the answer is the prior")
    return columns, said


def _answers(estimate: Estimate) -> dict[str, NDArray[np.float64]]:
    """Mean, std and interval of every parameter, by column name."""
    found = {}
    for i, name in enumerate(estimate.names):
        key = column(name)
        found[key] = estimate.mean[:, i]
        found[f"{key}_std"] = estimate.std[:, i]
        found[f"{key}_p05"] = estimate.low[:, i]
        found[f"{key}_p95"] = estimate.high[:, i]
    return found


def _stacked(estimates: list[Estimate]) -> Estimate:
    first = estimates[0]
    parts = {
        key: np.stack([getattr(e, key) for e in estimates])
        for key in ("mean", "std", "covariance", "low", "high", "in_range")
    }
    return Estimate(names=first.names, units=first.units, prior=first.prior, **parts)


def _worth(estimate: Estimate, what: str, does: str, hint: str) -> list[str]:
    """What the estimates that are in range are worth, in words; abstaining where it is nothing."""
    if not estimate.in_range.any():
        return []
    share = np.median(estimate.std[estimate.in_range], axis=0) / estimate.prior_std
    names = [name.replace("_", " ") for name in estimate.names]
    shares = ", ".join(f"{name} {s:.0%}" for name, s in zip(names, share, strict=True))
    said = [f"width of the estimate against the prior's, {what}: {shares}"]
    vague = [name for name, ok in zip(names, is_identified(share), strict=True) if not ok]
    if vague:
        said.append(
            f"{' and '.join(vague)}: mostly the prior, {what} {does} not tell; {hint} to learn more"
        )
    return said
