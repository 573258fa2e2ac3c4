"""`soilml drive map`: the soil along a drive, and where a rover can climb."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.option_values import NumberFrom
from soilml.cli.options import InputFile, folder_outputs

SIZE = NumberFrom(0.01, 1000.0, "m")  # Of a cell, and how far a reading reaches
DESCRIPTION = """\
Make a map of the soil from the rows of a drive with positions: its parameters
with uncertainty, where the soil changes, and for its rover the probability of
climbing, the slip that slopes need, and the work of the wheels.

  soilml drive map ROVER.toml DRIVE.csv --out map
  soilml drive map ROVER.toml DRIVE.csv --slope 0,10,20 --cell 0.25 --out map

DRIVE.csv has x_m, y_m, slip, torque_Nm and load_N; several wheels also wheel
and time_s. Positions are those of the wheel's contact, or those of the rover's
origin where heading_rad and [rover.wheels] say where the wheels are.

ROVER.toml has [gear], [soil], [soil.prior], [noise] and [rover].
The soil is estimated by the released file for wheels of any size, or by that
of --from, in stretches between changes that `SoilTracker` finds. A Gaussian
process over position joins them.

The folder has map.tif (GeoTIFF), costmap.yaml and costmap.pgm for Nav2, whose
occupancy is the probability of not climbing the steepest slope of --slope,
map.png and map.json.
"""
ARGUMENTS = (
    ("rover ROVER.toml", "wheel, soil, rover", InputFile),
    ("runs DRIVE.csv", "rows with positions", InputFile),
    ("--from MODEL.onnx", "trained file for this wheel (default: any_wheel)", InputFile),
    ("--slope DEG,...", "slopes in degrees (default: 0,5,10,15)"),
    ("--cell M", "side of a cell (default: 0.5)", SIZE),
    ("--reach M", "distance from a reading up to which the soil is known (default: 2)", SIZE),
    "effects",
    "rows",
    ("--out FOLDER", "folder for the files"),
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files of the folder."""
    from soilml.soil_maps.workflow import FILES

    return folder_outputs("--out", args.out, FILES)


def run(args: argparse.Namespace) -> int:
    """Make the map and write its folder."""
    import numpy as np

    from soilml.cli.option_values import parse_numbers
    from soilml.cli.options import available_effects
    from soilml.cli.output import show_result
    from soilml.cli.progress import stage_progress
    from soilml.cli.tables import read_case_of_rows, read_rows
    from soilml.io.atomic_files import write_files
    from soilml.onboard.estimator import Estimator
    from soilml.optional_imports import need
    from soilml.soil_maps.local_soils import NEEDED
    from soilml.soil_maps.workflow import CELL, REACH, SLOPES, soil_map

    if args.out is not None:
        need("tifffile", "drive map --out", "map")
        need("matplotlib", "drive map --out")
    table = read_rows(args, NEEDED, NEEDED[:2])
    case = read_case_of_rows(
        args, args.rover, table, available_effects(args), with_explanations=True
    )
    with stage_progress() as progress:
        found = soil_map(
            case,
            table,
            None if args.from_ is None else Estimator.load(args.from_),
            cell=CELL if args.cell is None else args.cell,
            reach=REACH if args.reach is None else args.reach,
            slopes=SLOPES if args.slope is None
            else np.deg2rad(np.sort(parse_numbers("--slope", args.slope))),
            progress=progress,
        )  # fmt: skip
    report = found.report()
    if args.out is not None:
        folder = Path(args.out)
        files = found.files(folder, report.pictures[0].save)
        write_files(files, folders=[folder])
    show_result(report, found.as_json())
    return 0
