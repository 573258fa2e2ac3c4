"""`soilml bevameter`: soil parameters from plate-sinkage and shear tests."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from soilml.cli.options import SEVERAL, InputFile, OutputFile
from soilml.errors import InputError, MissingLibraryError, SoilmlError, TableError

if TYPE_CHECKING:
    from soilml.io.table import Table
    from soilml.remarks import Remark

FORMATS = ("table", "json")
DESCRIPTION = """\
Fit kc, kphi and n to plate-sinkage tests, and cohesion, friction angle and
shear modulus to shear tests. Say what the tests cannot tell, such as kc apart
from kphi with plates of one size.

  soilml bevameter PLATES.csv SHEAR.csv
  soilml bevameter PLATES.csv --model MODEL.toml --out SOIL.toml
  soilml bevameter SHEAR.csv --out SOIL.toml --picture tests.png

Several tables of a kind are taken together; their columns tell which kind.

PLATES.csv has test, sinkage_m, pressure_Pa or load_N, and the plate:
plate_radius_m, plate_area_m2 of a round plate, or plate_width_m and
plate_length_m. SHEAR.csv has test, normal_stress_Pa, shear_displacement_m and
shear_stress_Pa; for a ring inner_radius_m, outer_radius_m, angle_rad,
torque_Nm, and load_N or normal_stress_Pa. A blank displacement or angle marks
the steady end of a test. Without them each row is the strength of a test, and
K is not measured. Other names are taken where the header states units, such as
z [mm].

Ranges follow from how tests scatter. The second range is where the value at
another place of the soil would lie, and is the prior that --out writes for
identify and gap, with [[soil.test]]. With --model, SOIL.toml is that model
file with this soil; without it, [soil] with priors and tests alone.
"""
#: Bounds of columns that differ from those of measured runs: a plate starts without load.
LIMITS = {
    "load_N": (-math.inf, math.inf, "a load in N"),
    "sinkage_m": (-1.0, 2.0, "a sinkage in m, below 2"),
    "angle_rad": (-6.3, 6.3, "an angle in rad, of less than a turn"),
    "normal_stress_Pa": (0.0, math.inf, "a normal stress above zero, in Pa"),
    "inner_radius_m": (-1e-9, 10.0, "a radius in m"),
}
ARGUMENTS = (
    ("tables TABLE.csv", "plate tests, shear tests, or both; CSV or Parquet", InputFile, SEVERAL),
    ("--model MODEL.toml", "whose gear, noise and other soil values to take", InputFile),
    ("--out SOIL.toml|.json", "write the soil as a model file, or estimates as JSON", OutputFile),
    ("--picture FILE.png", "draw the tests and the fitted laws", OutputFile),
    "ignore-extra",
    "effects",
)


def run(args: argparse.Namespace) -> int:
    """Fit the tests, print the result and write the files."""
    from soilml.cli.options import available_effects, is_json
    from soilml.cli.output import deliver, tell
    from soilml.cli.progress import working
    from soilml.config.case import read_case
    from soilml.identification.bevameter import bevameter
    from soilml.identification.bevameter.soil_section import missing_values, model_file_text

    as_json = args.out is not None and is_json(args)
    plates, shear, left = _tables(args)
    case = None if args.model is None else read_case(args.model, available_effects(args))
    with working("fitting the tests"):
        result = bevameter(plates, shear, case)
    result = replace(result, remarks=(*left, *result.remarks))
    others = {}
    if args.out is not None and not as_json:
        others = {args.out: model_file_text(result, case, ", ".join(args.tables))}
        if case is None and (missing := missing_values(result)):
            tell(f"{args.out} lacks {', '.join(missing)}: add them, or give --model")
    deliver(args, result.report(), result.as_json(), others=others)
    return 0


def _table(path: str, ignore_extra: bool) -> Table:
    """A table of tests; what other names and units are taken for is printed."""
    from soilml.cli.output import tell
    from soilml.io.read_table import check_table, read_table
    from soilml.log_import.soil_tests import read_soil_tests
    from soilml.optional_imports import need

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


def _tables(args: argparse.Namespace) -> tuple[Table | None, Table | None, list[Remark]]:
    """The plate tests, the shear tests, and remarks on tables that are left out.

    Raises the error of the first table where none can be used.
    """
    from soilml.identification.bevameter.tables import read_plate_tests, read_shear_tests
    from soilml.remarks import Remark

    found: dict[str, list[Table]] = {}
    errors: list[SoilmlError] = []
    remarks: list[Remark] = []
    if len({Path(path).resolve() for path in args.tables}) < len(args.tables):
        raise InputError("a table is given twice; give each once")
    for path in args.tables:
        try:
            table = _table(path, args.ignore_extra)
            kind = _kind(path, table)
            (read_shear_tests if kind == "shear" else read_plate_tests)(table)
        except MissingLibraryError:
            raise
        except SoilmlError as error:
            errors.append(error)
            remarks.append(Remark("table-left-out", f"left out: {error}", (path,)))
        else:
            found.setdefault(kind, []).append(table)
    if not found:
        raise errors[0]
    plates, shear = (_together(found.get(kind, [])) for kind in ("plate", "shear"))
    return plates, shear, remarks


def _kind(path: str, table: Table) -> str:
    """Plate or shear tests, by their columns."""
    if "shear_stress_Pa" in table or "torque_Nm" in table:
        return "shear"
    if "sinkage_m" in table:
        return "plate"
    raise TableError(
        f"{path} is no table of tests: plate tests have sinkage_m, shear tests have "
        f"shear_stress_Pa or torque_Nm; found: {', '.join(table.columns)}"
    )


def _together(tables: list[Table]) -> Table | None:
    """Tables of one kind as one; tests of one name in two tables are two tests.

    Raises `InputError` where their columns differ.
    """
    import numpy as np

    from soilml.io.table import Table

    if len(tables) < 2:
        return tables[0] if tables else None
    first = tables[0]
    for other in tables[1:]:
        if {*other.columns} != {*first.columns}:
            raise InputError(
                f"{first.source} and {other.source} have different columns ("
                f"{', '.join(first.columns)}; {', '.join(other.columns)}); put them in one table"
            )
    names = [name for table in tables for name in {*table["test"].tolist()}]
    alike = len({*names}) < len(names)
    labels = [
        f"{Path(table.source).stem} {name}" if alike else name
        for table in tables
        for name in table["test"].tolist()
    ]
    columns = {key: np.concatenate([table[key] for table in tables]) for key in first.columns}
    source = ", ".join(table.source for table in tables)
    return Table({**columns, "test": np.asarray(labels)}, source)
