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
estimate. Needs numpy and onnxruntime alone.
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
    whole = np.all([np.isfinite(table[column(n)]) for n in estimator.inputs], axis=0)
    if not whole.any():
        needed = ", ".join(column(n) for n in estimator.inputs)
        raise TableError(f"{table.source}: no row has all that this model reads: {needed}")
    if args.by is None:
        columns, said = _row_by_row(estimator, table, whole)
    else:
        columns, said = _by(estimator, table.rows(whole), args.by)
    deliver(columns, args.out)
    if not whole.all():
        blank = ", ".join(str(table.place(int(i))) for i in np.flatnonzero(~whole)[:3])
        said.append(f"{int((~whole).sum())} rows lack a reading and get no estimate: {blank}, ...")
    print("\n".join(said), file=sys.stderr)
    return 0


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


def _by(estimator: Estimator, table: Table, by: str) -> tuple[dict[str, Any], list[str]]:
    """A line for every value of a column, from all its rows together."""
    groups = list(table.groups(by))
    estimates = [estimator.run(**_readings(estimator, rows)) for _, rows in groups]
    sound = [int(estimator(**_readings(estimator, rows)).in_range.sum()) for _, rows in groups]
    estimate = _stacked(estimates)
    columns: dict[str, Any] = {
        by: np.asarray([name for name, _ in groups]),
        "rows": np.asarray([len(rows) for _, rows in groups]),
        "rows_in_range": np.asarray(sound),
    }
    columns |= _answers(estimate)
    columns["in_range"] = estimate.in_range
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
    return Estimate(names=first.names, units=first.units, prior_std=first.prior_std, **parts)


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
