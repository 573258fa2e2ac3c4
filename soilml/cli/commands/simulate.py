"""`soilml simulate`: forces on a running gear over slip and load."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from soilml.cli.option_values import NumberFrom
from soilml.cli.options import REQUIRED, InputFile, OutputFile
from soilml.errors import InputError

if TYPE_CHECKING:
    from soilml.io.table import Table
    from soilml.report.report import Picture

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Solve the equilibrium of gear and soil of MODEL.toml at every combination of
the slips and loads.

  soilml simulate MODEL.toml --slip 0:0.6:13 --load 60 --out curve.csv
  soilml simulate MODEL.toml --slip -0.3,0,0.3 --load 30:120:4 --run sim

Ranges are start:stop:count, or values with commas. --run names the run that
`soilml identify` reads in the table. A row without equilibrium has blank
values and the reason in the column `status`; it is an error if no row has an
equilibrium. The mean of a [remainder] of MODEL.toml is added; --std gives its
uncertainty.
--efficiency adds tractive efficiency (1 - s) r DP/T, and pull efficiency with
its class (Comin and Saaj 2017, eq. 32).
"""
ARGUMENTS = (
    ("model MODEL.toml", "gear, soil and effects", InputFile),
    ("--slip S,...", "slip ratios, above 0 driving, below 0 braking", REQUIRED),
    ("--load N,...", "vertical loads in N", REQUIRED),
    ("--speed M_S", "speed in m/s, below 0 in reverse", NumberFrom(-100.0, 100.0, "m/s")),
    ("--pass N", "number of the pass: 1 on undisturbed soil", NumberFrom(1.0, 1e4)),
    ("--slip-angle DEG", "between wheel plane and path", NumberFrom(-91.0, 91.0, "degrees")),
    "effects",
    "gear",
    ("--run NAME", "add a first column `run` with this name", {"dest": "label"}),
    ("--std", "add the std of the model's error from [remainder]"),
    ("--efficiency", "add tractive efficiency and pull efficiency"),
    ("--out FILE.csv", "write the table to this file", OutputFile),
    ("--picture FILE.png", "draw the columns against slip", OutputFile),
)


def run(args: argparse.Namespace) -> int:
    """Simulate and write the table."""
    import numpy as np

    from soilml.cli.option_values import parse_numbers
    from soilml.cli.options import available_effects
    from soilml.cli.output import write_columns
    from soilml.cli.progress import progress_bar
    from soilml.config.case import read_case_of_one_gear
    from soilml.fitting.covariance import ignored_discrepancy
    from soilml.fitting.global_optimum import missing_peak
    from soilml.fitting.simulation import simulate
    from soilml.io.bounds import ROWS
    from soilml.io.table import fault_of_text
    from soilml.physics.operating_point import Operating
    from soilml.row_status import Status

    if args.label is not None and (fault := fault_of_text(args.label)):
        raise InputError(f"--run: {fault}")
    slips, loads = parse_numbers("--slip", args.slip), parse_numbers("--load", args.load)
    case = read_case_of_one_gear(
        args.model, available_effects(args), args.gear, with_explanations=True
    )
    if args.std and case.remainder is None:
        raise InputError(f"--std: {args.model} has no [remainder]; soilml gap learns one")
    if slips.size * loads.size > ROWS.most:
        raise InputError(
            f"{slips.size} slips and {loads.size} loads are {slips.size * loads.size} rows; "
            f"at most {ROWS.most} are possible"
        )
    slip, load = (grid.ravel() for grid in np.meshgrid(slips, loads))
    angle = None if args.slip_angle is None else np.deg2rad(args.slip_angle)
    known = {"speed": args.speed, "pass_number": args.pass_, "slip_angle": angle}
    options: dict[str, Any] = {**known, "run": args.label, "with_std": args.std}
    options["with_efficiency"] = args.efficiency
    with progress_bar(f"simulating {slip.size} rows", slip.size) as done:
        rows = simulate(case, slip, load, on_rows=done, **options)
    failed = int(np.count_nonzero(~rows.answered))
    if failed == slip.size:
        force = case.model(case.soil, Operating(slip=slip[:1], load=load[:1], **known))
        if missing := missing_peak(case, Operating(slip=slip[:1], load=load[:1], **known)):
            raise InputError(f"no row has an equilibrium or a stress profile: {missing}")
        worst = Status(int(force.status[0]))
        limit = f" (at most {force.load.max():.4g} N)" if worst is Status.TOO_HEAVY else ""
        raise InputError(
            f"no row has an equilibrium; {worst.reason}{limit}: change --load or the soil"
        )
    write_columns(rows.columns, args.out, args.picture, _picture(rows, loads.size))
    for line in ignored_discrepancy(case, "simulate", "the rows have no error of the model"):
        print(line, file=sys.stderr)
    if failed:
        print(f"{failed} of {slip.size} rows have no equilibrium: see status", file=sys.stderr)
    return 0


def _picture(rows: Table, loads: int) -> Picture:
    """Forces, sinkage, and what was asked for beside them, against slip, a line for each load."""
    from soilml.report.column_figure import column_picture

    panels: list[tuple[str, ...]] = [("torque_Nm",), ("drawbar_pull_N",), ("sinkage_m",)]
    panels += [(name,) for name in ("tractive_efficiency", "pull_efficiency") if name in rows]
    return column_picture(rows.columns, "slip", panels, ("load_N",) if loads > 1 else ())
