"""`soilml estimate`: a trained model on measured rows, as on board."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.commands.identify import add_row_options, chosen_rows
from soilml.commands.output import deliver
from soilml.errors import InputError, TableError
from soilml.estimate import Estimate
from soilml.needs import need
from soilml.onboard import LEAST_SOUND, Estimator
from soilml.quantities import QUANTITIES, column
from soilml.reading import RUNS
from soilml.saving import named
from soilml.table import Table

#: Share of the prior's width above which an estimate is mostly the prior.
VAGUE = 0.8

HELP = "soil parameters from measured rows, by a trained model file"
DESCRIPTION = """\
Estimate soil parameters with MODEL.onnx, just as the onboard runtime does.

  soilml estimate exported/wheel.onnx RUNS.csv --out estimates.csv
  soilml estimate exported/wheel.onnx RUNS.csv --by run

Each row gets a mean, a standard deviation and a 90 % interval (_p05, _p95) of every parameter, and
in_range: 0 where the readings are unlike anything that the model was trained on; the answer is then
the prior. One row brings one equation for three unknowns, so its estimate is mostly the prior; with
--by run, all rows of a run are joined, which can say far more; rows that contradict each other, or
of which more than a tenth is out of range, give the prior. A row with a blank reading gets a blank
estimate, and so does one whose status is not ok. Needs numpy and onnxruntime alone.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", metavar="MODEL.onnx")
    parser.add_argument("runs", metavar="RUNS.csv", help="measured rows, CSV or Parquet")
    parser.add_argument("--by", metavar="run", help="one estimate for each value of this column")
    add_row_options(parser)
    parser.add_argument("--out", metavar="FILE.csv", help="where to write the estimates")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return named(args.out, ".csv")


def run(args: argparse.Namespace) -> int:
    """Estimate and deliver the table."""
    need("onnxruntime", "estimate")
    estimator = Estimator.load(args.model)
    table = chosen_rows(args, RUNS)
    _same_wheel(estimator, table)
    measured = np.all([np.isfinite(table[column(n)]) for n in estimator.inputs], axis=0)
    whole = measured & table.answered
    if not whole.any():
        needed = ", ".join(column(n) for n in estimator.inputs)
        raise TableError(f"{table.source}: no row has all that this model reads: {needed}")
    if args.by is None:
        columns, said = _row_by_row(estimator, table, whole)
    else:
        columns, said = _by(estimator, table, whole, args.by)
    deliver(columns, args.out)
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


def _row_by_row(
    estimator: Estimator, table: Table, whole: NDArray[np.bool_]
) -> tuple[dict[str, Any], list[str]]:
    """A line for every row; blank where a reading is missing."""
    estimate = estimator(**_readings(estimator, table.rows(whole)))
    columns: dict[str, Any] = {"run": table["run"]}
    columns |= {column(name): table[column(name)] for name in estimator.inputs}
    place = np.where(whole, np.cumsum(whole) - 1, 0)
    for key, values in _answers(estimate).items():
        columns[key] = np.where(whole, values[place], np.nan)
    columns["in_range"] = whole & estimate.in_range[place]
    said = _worth(estimate, "one row alone", "join rows with --by run")
    outside = int(np.count_nonzero(~estimate.in_range))
    if outside:
        said.append(
            f"{outside} of {estimate.in_range.size} rows are out of range: theirs is the prior"
        )
    return columns, said


def _by(
    estimator: Estimator, table: Table, whole: NDArray[np.bool_], by: str
) -> tuple[dict[str, Any], list[str]]:
    """A line for every value of a column, from all its rows together; blank where none is whole."""
    order = [name for name, _ in table.groups(by)]
    groups = list(table.rows(whole).groups(by))
    estimates = [estimator.run(**_readings(estimator, rows)) for _, rows in groups]
    sound = [int(estimator(**_readings(estimator, rows)).in_range.sum()) for _, rows in groups]
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
    said = _worth(estimate, f"all rows of a {by}", "drive other loads and slips")
    for (name, rows), good, one in zip(groups, sound, estimates, strict=True):
        if not one.in_range:
            why = f"{len(rows) - good} of {len(rows)} rows are out of range"
            if good >= LEAST_SOUND * len(rows):
                why = "its rows contradict each other as rows of one soil hardly ever do"
            said.append(f"{by} {name}: {why}; the answer is the prior")
    return columns, said


def _readings(estimator: Estimator, table: Table) -> dict[str, Any]:
    return {name: table[column(name)] for name in estimator.inputs}


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


def _same_wheel(estimator: Estimator, table: Table) -> None:
    """A table that says which wheel was driven must say the one that the model was trained for."""
    gear = json.loads(estimator.metadata["gear"])
    for name in ("radius", "width"):
        key = QUANTITIES[f"wheel_{name}"].column
        if key in table and name in gear:
            _refuse(table, key, np.abs(table[key] / gear[name] - 1.0) > 0.005, f"{gear[name]:g}")
    effects = json.loads(estimator.metadata["recipe"]).get("effect", [])
    key = QUANTITIES["grouser_height"].column
    if key in table and not any(effect["name"] == "grousers" for effect in effects):
        _refuse(table, key, table[key] > 0.0, "a wheel without lugs")


def _refuse(table: Table, key: str, wrong: NDArray[np.bool_], trained: str) -> None:
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            f"{table.place(row)}, column {key}: {table[key][row]:g} given, the model was trained "
            f"for {trained}; choose rows with --where, or train one for this wheel"
        )


def _stacked(estimates: list[Estimate]) -> Estimate:
    first = estimates[0]
    parts = {
        key: np.stack([getattr(e, key) for e in estimates])
        for key in ("mean", "std", "covariance", "low", "high", "in_range")
    }
    return Estimate(names=first.names, units=first.units, prior=first.prior, **parts)


def _worth(estimate: Estimate, what: str, hint: str) -> list[str]:
    """What the estimates that are in range are worth, in words."""
    if not estimate.in_range.any():
        return []
    share = np.median(estimate.std[estimate.in_range], axis=0) / estimate.prior_std
    names = [name.replace("_", " ") for name in estimate.names]
    shares = ", ".join(f"{name} {s:.0%}" for name, s in zip(names, share, strict=True))
    said = [f"width of the estimate against the prior's, {what}: {shares}"]
    vague = [name for name, s in zip(names, share, strict=True) if s > VAGUE]
    if vague:
        said.append(f"{' and '.join(vague)}: mostly the prior; {hint} to learn more")
    return said
