"""The wheel that `estimate` assumes, and whether it is that of the table."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

import numpy as np

from soilml.errors import InputError, TableError
from soilml.identification.compatibility import check_wheel_columns
from soilml.io.table import Table
from soilml.onboard.estimator import Estimator
from soilml.optional_imports import need
from soilml.quantities import QUANTITIES

if TYPE_CHECKING:
    from soilml.config.case import Case

_HINT = "select rows with --where, or train a model for this wheel"


def apply_case_option(
    args: argparse.Namespace, estimator: Estimator
) -> tuple[Estimator, Case | None, list[str]]:
    """The estimator for the wheel and soil of `--case`, the case, and notes on what it ignores.

    Raises `InputError` where a file for wheels of any size has no case, or another file has one.
    """
    any_wheel = estimator.sets is not None and bool(estimator.sets.missing_context)
    if any_wheel and args.case is None:
        raise InputError(
            f"{args.model} is for wheels of any size: give --case MODEL.toml with your [gear], "
            "[soil], [soil.prior] and [noise]"
        )
    if args.case is None:
        return estimator, None, []
    if not any_wheel:
        raise InputError(f"{args.model} is for one wheel only; omit --case")
    need("array_api_compat", "estimate --case")
    from soilml.config.case import read_case_of_one_gear
    from soilml.identification.trained_estimator import condition_on_case

    case = read_case_of_one_gear(args.case, gear=args.gear)
    conditioned, notes = condition_on_case(estimator, case)
    if case.discrepancy:
        notes.append(
            f"[discrepancy] of {', '.join(case.discrepancy)} is included as independent errors of "
            "the rows, enlarged by the rows that are alike: intervals are wider than those of "
            "soilml identify"
        )
    return conditioned, case, notes


def check_table_wheel(estimator: Estimator, table: Table) -> None:
    """Raise `TableError` where the table's wheel columns differ from the wheel of the training."""
    gear = json.loads(estimator.metadata["gear"])
    fixed = estimator.sets.context_values if estimator.sets is not None else {}
    sizes = {n: fixed.get(f"wheel_{n}", gear.get(n)) for n in ("radius", "width")}
    check_wheel_columns(table, sizes, "the model was trained for", _HINT)
    effects = json.loads(estimator.metadata["recipe"]).get("effect", [])
    key = QUANTITIES["grouser_height"].column
    if key in table and not any(effect["name"] == "grousers" for effect in effects):
        lugs = table[key] > 0.0
        if lugs.any():
            row = int(np.argmax(lugs))
            raise TableError(
                f"{table.place(row)}, column {key}: {table[key][row]:g} given, the model was "
                f"trained for a wheel without lugs; {_HINT}"
            )
