"""`soilml drive slip`: slip, speed and soil of a rover without odometry."""

from __future__ import annotations

import argparse

from soilml.cli.options import InputFile, OutputFile

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Infer body speed, slip of each wheel and the soil along a drive whose speed
nobody measured, from torques, rim speeds and pitch, with 90 % intervals.

  soilml drive slip ROVER.toml DRIVE.csv --out slip.csv --picture slip.png

ROVER.toml has [gear], [soil] with [soil.prior], [rover] with mass and wheels,
and [drive]: torque_per_ampere, the friction of the drives and their errors.

DRIVE.csv has a row for each time and wheel: time_s, wheel (a name in
[rover.wheels]), rim_speed_m_s or wheel_speed_rad_s, torque_Nm or current_A,
and slope_rad, the pitch, positive uphill. Optional are roll_rad (positive
where the left side is higher) and load_N. Without load_N, the loads follow
from mass and positions.

All wheels share one body speed, at which they pull what the slope requires.
Torques weigh the soils of the prior. The result has a row for each time;
flags say which rows are refused (standing, hard floor) and where the slip is
not determined. FILE.json has the same with remarks.
"""
ARGUMENTS = (
    ("rover ROVER.toml", "rover and prior", InputFile),
    ("drive DRIVE.csv", "a row for each time and wheel", InputFile),
    "effects",
    "ignore-extra",
    ("--out FILE.csv|.json", "write the table to this file, or FILE.json", OutputFile),
    ("--picture FILE.png", "draw slip, speed and pitch against time", OutputFile),
)


def run(args: argparse.Namespace) -> int:
    """Infer and write."""
    from soilml.cli.options import available_effects
    from soilml.cli.output import deliver
    from soilml.cli.progress import working
    from soilml.cli.tables import read_long_table
    from soilml.config.case import read_case
    from soilml.slip_filter.drive import read_drive, slip_of_drive

    driven = read_long_table(args.drive, ignore_extra=args.ignore_extra)
    case = read_case(args.rover, available_effects(args), with_explanations=True)
    rows = read_drive(driven, case)
    with working(f"inferring from {len(rows.time)} rows"):
        found = slip_of_drive(case, rows)

    deliver(args, found.report(), found.as_json(), found.frame_columns())
    return 0
