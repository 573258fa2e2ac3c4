"""For which wheel `estimate` asks a model file, and whether the table is of that wheel."""

from __future__ import annotations

import argparse
import json

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.io.table import Table
from soilml.onboard.estimator import Estimator
from soilml.optional_imports import need
from soilml.quantities import QUANTITIES


def for_the_case(args: argparse.Namespace, estimator: Estimator) -> tuple[Estimator, list[str]]:
    """The estimator for the wheel and soil of --case, where the file serves many."""
    many = estimator.sets is not None and bool(estimator.sets.needs)
    if many and args.case is None:
        raise InputError(
            f"{args.model} is for wheels of any size: give --case MODEL.toml, with [gear], [soil], "
            "[soil.prior] and [noise] of yours"
        )
    if args.case is None:
        return estimator, []
    if not many:
        raise InputError(f"{args.model} is for one wheel already; leave out --case")
    need("array_api_compat", "estimate --case")
    from soilml.config.case import read_case
    from soilml.identification.trained_estimator import condition_on_case

    return condition_on_case(estimator, read_case(args.case))


def check_same_wheel(estimator: Estimator, table: Table) -> None:
    """A table that says which wheel was driven must say the one that the model was trained for."""
    gear = json.loads(estimator.metadata["gear"])
    given = estimator.sets.given if estimator.sets is not None else {}
    for name in ("radius", "width"):
        key, own = QUANTITIES[f"wheel_{name}"].column, given.get(f"wheel_{name}", gear.get(name))
        if key in table and own is not None:
            _refuse(table, key, np.abs(table[key] / own - 1.0) > 0.005, f"{own:g}")
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
