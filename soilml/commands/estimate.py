"""`soilml estimate`: a trained model on measured rows, as on board."""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

import numpy as np

from soilml.commands.identify import add_row_options, chosen_rows
from soilml.commands.output import deliver
from soilml.errors import InputError, TableError
from soilml.estimate import Estimate
from soilml.needs import need
from soilml.onboard import Estimator
from soilml.quantities import QUANTITIES, column
from soilml.reading import RUNS
from soilml.table import Table

HELP = "soil parameters from measured rows, by a trained model file"
DESCRIPTION = """\
Estimate soil parameters with MODEL.onnx, just as the onboard runtime does.

  soilml estimate exported/wheel.onnx RUNS.csv --out estimates.csv
  soilml estimate exported/wheel.onnx RUNS.csv --by run

Each row gets a mean, a standard deviation and a 90 % interval (_p05, _p95) of every parameter, and
in_range: 0 where the readings are unlike anything that the model was trained on; the answer is then
the prior. One row brings one equation for three unknowns, so its estimate is mostly the prior; with
--by run, all rows of a run are joined, which says far more. Needs numpy and onnxruntime alone.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", metavar="MODEL.onnx")
    parser.add_argument("runs", metavar="RUNS.csv", help="measured rows, CSV or Parquet")
    parser.add_argument("--by", metavar="run", help="one estimate for each value of this column")
    add_row_options(parser)
    parser.add_argument("--out", metavar="FILE.csv", help="where to write the estimates")


def run(args: argparse.Namespace) -> int:
    """Estimate and deliver the table."""
    need("onnxruntime", "estimate")
    estimator = Estimator.load(args.model)
    table = chosen_rows(args, RUNS)
    _same_wheel(estimator, table)
    columns: dict[str, Any] = {}
    if args.by is None:
        estimate = estimator(**_readings(estimator, table))
        columns["run"] = table["run"]
        columns |= {column(name): table[column(name)] for name in estimator.inputs}
    else:
        groups = list(table.groups(args.by))
        estimates = [estimator.run(**_readings(estimator, rows)) for _, rows in groups]
        estimate = _stacked(estimates)
        columns[args.by] = np.asarray([name for name, _ in groups])
        columns["rows"] = np.asarray([len(rows) for _, rows in groups])
    for i, name in enumerate(estimate.names):
        key = column(name)
        columns[key] = estimate.mean[:, i]
        columns[f"{key}_std"] = estimate.std[:, i]
        columns[f"{key}_p05"] = estimate.low[:, i]
        columns[f"{key}_p95"] = estimate.high[:, i]
    columns["in_range"] = estimate.in_range
    deliver(columns, args.out)
    print(_said(estimate, args.by), file=sys.stderr)
    return 0


def _readings(estimator: Estimator, table: Table) -> dict[str, Any]:
    found = {}
    for name in estimator.inputs:
        values = table[column(name)]
        if np.isnan(values).any():
            row = int(np.argmax(np.isnan(values)))
            raise TableError(
                f"{table.place(row)}, column {column(name)}: is blank; this model needs it in "
                "every row, leave the row out or choose rows with --where"
            )
        found[name] = values
    return found


def _same_wheel(estimator: Estimator, table: Table) -> None:
    gear = json.loads(estimator.metadata.get("gear", "{}"))
    for name in ("radius", "width"):
        key = QUANTITIES[f"wheel_{name}"].column
        if key in table and name in gear:
            wrong = np.abs(table[key] / gear[name] - 1.0) > 0.005
            if wrong.any():
                row = int(np.argmax(wrong))
                raise InputError(
                    f"{table.place(row)}, column {key}: {table[key][row]:g} given, the model was "
                    f"trained for {gear[name]:g}; choose rows with --where, or train one for it"
                )


def _stacked(estimates: list[Estimate]) -> Estimate:
    first = estimates[0]
    parts = {
        key: np.stack([getattr(e, key) for e in estimates])
        for key in ("mean", "std", "covariance", "low", "high", "in_range")
    }
    return Estimate(names=first.names, units=first.units, prior_std=first.prior_std, **parts)


def _said(estimate: Estimate, by: str | None) -> str:
    """What the estimates are worth, in words."""
    share = np.median(estimate.std[estimate.in_range], axis=0) / estimate.prior_std
    outside = int(np.count_nonzero(~estimate.in_range))
    lines = []
    if estimate.in_range.any():
        what = "one row alone" if by is None else f"a {by} as a whole"
        shares = ", ".join(
            f"{name.replace('_', ' ')} {s:.0%}"
            for name, s in zip(estimate.names, share, strict=True)
        )
        lines.append(f"width of the estimate against the prior's, {what}: {shares}")
        vague = [n.replace("_", " ") for n, s in zip(estimate.names, share, strict=True) if s > 0.8]
        if vague:
            hint = "join rows with --by run" if by is None else "drive other loads and slips"
            lines.append(f"{' and '.join(vague)}: mostly the prior; {hint} to learn more")
    if outside:
        lines.append(
            f"{outside} of {estimate.in_range.size} are out of range: there it is the prior"
        )
    return "\n".join(lines)
