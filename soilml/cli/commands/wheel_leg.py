"""`soilml paper wheel-leg`: the soil from torque, vibration and sinkage of strides."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from soilml.cli.options import InputFile, OutputFile
from soilml.errors import InputError

if TYPE_CHECKING:
    from soilml.io.table import Table

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Estimate friction angle and normal stiffness (the stress 1 cm deep) of one soil
from the strides of a wheel-leg, by the relations that Comin and Saaj 2017
print, and what they mean for a heavy rover that is to follow.

  soilml paper wheel-leg STRIDES.csv
  soilml paper wheel-leg STRIDES.csv --by run

STRIDES.csv has a row for each stride: run, slip, and one or more of torque_Nm
(at midstance), vibration_m_s2 (largest acceleration after it) and sinkage_m
(at midstance); blank where not measured. `soilml import` makes it from a log.
`fused` is the estimate by all sensors (eq. 30). Standard deviations include
the error that all strides on a soil share (table VIII).

The last row of each soil has k_phi and the pull efficiency of a wheel of a
300 kg rover (eq. 32) with its class. n, cohesion and shear modulus, which
strides do not show, are uniform over the four soils of the source, unless
--assume has them.

On a known soil the same relations give the slip of each stride:

  soilml paper wheel-leg STRIDES.csv --known SSC-2
  soilml paper wheel-leg STRIDES.csv --known 35.8,22000   degrees, Pa 1 cm deep

The relations are of one wheel-leg: five legs, Load Testing Feet, 3.75 kg. For
another train a file on its strides: soilml train slip_torque.
"""
SENSORS = {"torque_Nm": "torque", "vibration_m_s2": "vibration", "sinkage_m": "sinkage"}
ARGUMENTS = (
    ("runs STRIDES.csv", "strides: CSV, Parquet or .xlsx", InputFile),
    ("--assume NAME=VALUE,...", "n, cohesion (Pa) or shear_modulus (m) where they are known"),
    ("--known SOIL", "name of table I, or degrees,Pa: give the slip on this soil"),
    "by",
    "ignore-extra",
    ("--out FILE.csv", "write the table to this file", OutputFile),
    ("--picture FILE.png", "draw the soil by sensor, or the slip by stride", OutputFile),
    "report",
)


def run(args: argparse.Namespace) -> int:
    """Estimate and write the table."""
    from soilml.io.read_table import read_table

    known = args.known is not None
    if known and args.by is not None:
        raise InputError("--by asks for a soil of each group; --known gives the slip of each row")
    need = ("run",) if known else ("run", "slip")
    table = read_table(args.runs, need, filled=need, ignore_extra=args.ignore_extra)
    return _slip(args, table) if known else _soil(args, table)


def _slip(args: argparse.Namespace, table: Table) -> int:
    """The slip of each stride on a known soil."""
    import numpy as np

    from soilml.cli.output import tell, write_columns
    from soilml.report.column_figure import column_picture
    from soilml.systems.wheel_legs import slip_of_strides

    sensors = {
        SENSORS[name]: table[name] for name in ("torque_Nm", "vibration_m_s2") if name in table
    }
    columns = {"run": table["run"]} | ({"slip_measured": table["slip"]} if "slip" in table else {})
    columns |= slip_of_strides(sensors, *_known_soil(args.known))
    numbered = {**columns, "stride": np.arange(1, len(table) + 1)}
    panel = tuple(name for name in columns if name.startswith("slip") and not name.endswith("_std"))
    write_columns(columns, args.out, args.picture, column_picture(numbered, "stride", [panel]))
    outside = int(np.count_nonzero(~columns["in_range"] & np.isfinite(columns["slip"])))
    if outside:
        tell(f"{outside} of {len(table)} slips are outside of the 0 to 0.5 of the relations")
    return 0


def _known_soil(text: str) -> tuple[float, float]:
    """Friction angle (rad) and stiffness 1 cm deep (Pa) of `--known`."""
    import math

    from soilml.cli.option_values import parse_numbers
    from soilml.systems.wheel_legs.resistive_force import GROUNDS

    if text.upper() in GROUNDS:
        ground = GROUNDS[text.upper()]
        return ground.friction_angle, ground.normal_stiffness
    try:
        angle, stiffness = parse_numbers("--known", text).tolist()
    except (InputError, ValueError):
        angle = stiffness = math.nan
    if not (0.0 < angle < 90.0 and stiffness > 0.0):
        raise InputError(
            f"--known is {text!r}; needed is one of {', '.join(GROUNDS)}, or the friction angle in "
            "degrees and the stress 1 cm deep in Pa, such as 35.8,22000"
        )
    return math.radians(angle), stiffness


def _soil(args: argparse.Namespace, table: Table) -> int:
    """The soil by each sensor and fused, and what it means for a heavy rover."""
    from soilml.cli.output import deliver
    from soilml.cli.tables import result_by_group
    from soilml.systems.wheel_legs import Mobility, StrideSoil, mobility, soil_of_strides
    from soilml.systems.wheel_legs.strides import stride_columns, stride_report

    assumed = _assumed(args)

    def estimate(rows: Table) -> tuple[StrideSoil, Mobility]:
        readings = {sensor: rows[name] for name, sensor in SENSORS.items() if name in rows}
        soil = soil_of_strides(rows["slip"], readings)
        return soil, mobility(soil, known=assumed)

    found, failed = result_by_group(args, table, "estimating", estimate)
    columns: dict[str, list[Any]] = {}
    for name, (soil, means) in found.items():
        own = stride_columns(soil, means)
        group = {} if args.by is None else {args.by: [name] * len(soil.sensors)}
        for key, values in (group | own).items():
            columns.setdefault(key, []).extend(values)
    deliver(args, stride_report(found, failed, args.by), columns=columns)
    return 0


def _assumed(args: argparse.Namespace) -> dict[str, float]:
    """What is known of the soil by --assume."""
    from soilml.cli.option_values import named_numbers, parse_names
    from soilml.systems.wheel_legs.strides import UNKNOWN

    given = parse_names(args.assume) or []
    assumed = named_numbers(given, "--assume", "NAME=VALUE, such as n=0.7")
    if assumed.keys() - UNKNOWN.keys():
        raise InputError(f"--assume is {args.assume!r}; needed are {', '.join(UNKNOWN)}")
    return assumed
