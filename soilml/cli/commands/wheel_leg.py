"""`soilml wheel-leg`: the soil from torque, vibration and sinkage of a wheel-leg's strides."""

from __future__ import annotations

import argparse

from soilml.cli.options import InputFile, add_by_option, add_output, number

HELP = "soil from torque, vibration and sinkage of a wheel-leg"
DESCRIPTION = """\
Estimate friction angle and normal stiffness (the stress 1 cm deep) of one soil
from the strides of a wheel-leg, by the relations that Comin and Saaj 2017 print.

  soilml wheel-leg STRIDES.csv
  soilml wheel-leg STRIDES.csv --by run --torque-model empirical --out soil.csv

STRIDES.csv has a row for each stride: run, slip, and one or more of torque_Nm
(at midstance), vibration_m_s2 (largest acceleration after it) and sinkage_m
(at midstance); blank where not measured. Each sensor has an estimate, with a
standard deviation, and `fused` is that of all by eq. 30. It takes the errors of
sensors as independent. Those of torque and sinkage are not: its standard
deviations are then too small.

The relations are of one wheel-leg: five legs, load testing feet, 3.75 kg. For
another train a file on its strides: soilml train slip_torque.
"""
QUANTITIES = ("friction_angle_rad", "normal_stiffness_Pa")
SENSORS = {"torque_Nm": "torque", "vibration_m_s2": "vibration", "sinkage_m": "sinkage"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "runs", type=InputFile, metavar="STRIDES.csv", help="strides: CSV, Parquet or .xlsx"
    )
    parser.add_argument(
        "--torque-model",
        default="simplified",
        metavar="NAME",
        help="terramechanics, empirical or simplified (default), which needs one stride",
    )
    parser.add_argument(
        "--vibration-model",
        default="linear",
        metavar="NAME",
        help="planar, or linear (default), which needs one stride",
    )
    parser.add_argument("--torque-std", type=number, default=0.0, metavar="NM", help="std, N m")
    parser.add_argument(
        "--vibration-std", type=number, default=0.0, metavar="M_S2", help="std, m/s^2"
    )
    add_by_option(parser)
    parser.add_argument(
        "--ignore-extra", action="store_true", help="ignore columns whose names are not known"
    )
    add_output(parser, "--out", "FILE.csv", "write the table to this file")


def run(args: argparse.Namespace) -> int:
    """Estimate and write the table."""
    from soilml.cli.output import tell, write_columns
    from soilml.cli.tables import result_by_group, tell_failures
    from soilml.io.read_table import read_table
    from soilml.io.table import Table
    from soilml.systems.wheel_legs.soil_of_strides import StrideSoil, soil_of_strides

    table = read_table(args.runs, ("run", "slip"), ignore_extra=args.ignore_extra)

    def estimate(rows: Table) -> StrideSoil:
        return soil_of_strides(
            rows["slip"],
            {sensor: rows[name] for name, sensor in SENSORS.items() if name in rows},
            torque_model=args.torque_model,
            vibration_model=args.vibration_model,
            torque_std=args.torque_std,
            vibration_std=args.vibration_std,
        )

    found, failed = result_by_group(args, table, "estimating", estimate)
    columns: dict[str, list[object]] = {args.by: []} if args.by else {}
    keys = [f"{name}{std}" for name in QUANTITIES for std in ("", "_std")]
    columns |= {name: [] for name in ("sensor", *keys, "strides")}
    for name, one in found.items():
        head = f"{args.by} {name}: " if args.by else ""
        for k, sensor in enumerate(one.sensors):
            (angle, stiffness), (angle_std, stiffness_std) = one.mean[k], one.std[k]
            row = (sensor, angle, angle_std, stiffness, stiffness_std, one.strides[k])
            for key, value in zip(columns, (*((name,) if args.by else ()), *row), strict=True):
                columns[key].append(value)
        for sensor, why in one.unused.items():
            tell(f"{head}no estimate from {sensor}: {why}")
        if not one.in_range:
            tell(f"{head}the mean sinkage is outside of the 2 to 36 mm of its relation")
    write_columns(columns, args.out)
    tell_failures(args.by, failed)
    return 0
