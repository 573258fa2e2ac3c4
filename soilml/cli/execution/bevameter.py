"""`soilml bevameter`: soil parameters from plate-sinkage and shear tests."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from soilml.cli.option_values import available_effects
from soilml.cli.output import json_text, show, tell
from soilml.cli.progress import working
from soilml.config.case import read_case
from soilml.errors import InputError, MissingLibraryError, TableError
from soilml.identification.bevameter import BevameterResult, bevameter
from soilml.identification.bevameter.model_file import missing_values, model_file_text
from soilml.io.atomic_files import save_text
from soilml.io.read_table import Limits, check_table, read_table
from soilml.io.table import Table
from soilml.io.text_tables import format_table
from soilml.log_import.soil_tests import read_soil_tests
from soilml.optional_imports import need
from soilml.report.terminal import shown_unit, significant

#: Bounds of columns that differ from those of measured runs: a plate starts without load.
LIMITS: dict[str, Limits] = {
    "load_N": (-np.inf, np.inf, "a load in N"),
    "sinkage_m": (-1.0, 2.0, "a sinkage in m, below 2"),
    "angle_rad": (-6.3, 6.3, "an angle in rad, of less than a turn"),
    "normal_stress_Pa": (0.0, np.inf, "a normal stress above zero, in Pa"),
    "inner_radius_m": (-1e-9, 10.0, "a radius in m"),
}


def run(args: argparse.Namespace) -> int:
    """Fit the tests, print the result and write the files."""
    if args.picture is not None:
        need("matplotlib", "bevameter --picture")
    case = None if args.model is None else read_case(args.model, available_effects(args))
    plates, shear = _tables(args)
    with working("fitting the tests"):
        result = bevameter(plates, shear, case)
    if args.picture is not None:
        from soilml.identification.bevameter.plot import save_picture

        save_picture(args.picture, result)
    if args.json is not None:
        save_text(args.json, json_text(result.as_json()))
    if args.out is not None:
        save_text(args.out, model_file_text(result, case, ", ".join(args.tables)))
        if case is None and (missing := missing_values(result)):
            print(
                f"{args.out} lacks {', '.join(missing)}: add them, or give --model", file=sys.stderr
            )
    show(_text(result))
    return 0


def _table(path: str, ignore_extra: bool) -> Table:
    """A table of tests; where it has other names and units, it is told what they are taken for."""
    try:
        return read_table(
            path, ("test",), filled=("test",), ignore_extra=ignore_extra, limits=LIMITS
        )
    except TableError as error:
        try:
            need("pint", "bevameter")
            found = read_soil_tests(path)
        except MissingLibraryError:
            found = None
        if found is None:
            raise error from None
    tell(f"! {found}")
    return check_table(found.table, Path(path), ("test",), ("test",), LIMITS)


def _tables(args: argparse.Namespace) -> tuple[Table | None, Table | None]:
    """The plate tests and the shear tests, told apart by their columns."""
    found: dict[str, Table] = {}
    for path in args.tables:
        table = _table(path, args.ignore_extra)
        if "shear_stress_Pa" in table or "torque_Nm" in table:
            kind = "shear"
        elif "sinkage_m" in table:
            kind = "plate"
        else:
            raise TableError(
                f"{path} is no table of tests: plate tests have sinkage_m, shear tests have "
                f"shear_stress_Pa or torque_Nm; found: {', '.join(table.columns)}"
            )
        if kind in found:
            raise InputError(
                f"{path} and {found[kind].source} are both {kind} tests; put them in one table"
            )
        found[kind] = table
    return found.get("plate"), found.get("shear")


def _text(result: BevameterResult) -> str:
    rows = [
        (
            name,
            significant(factor * e.value),
            _range(e.mean_range, factor),
            _range(e.place_range, factor),
            unit,
        )
        for name, e in result.estimates().items()
        for factor, unit in [shown_unit(e.unit, e.value)]
    ]
    head = ("parameter", "value", "95 % of the mean", "95 % at another place", "unit")
    return "\n".join([format_table(head, rows), *(f"! {text}" for text in result.remarks)])


def _range(ends: tuple[float, float], factor: float) -> str:
    return f"{significant(factor * ends[0], 3)} .. {significant(factor * ends[1], 3)}"
