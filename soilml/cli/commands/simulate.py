"""`soilml simulate`: forces on a running gear over slip and load."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from soilml.cli.options import InputFile, add_effects_option, add_gear_option, add_output, number
from soilml.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from soilml.config.case import Case

    Floats = NDArray[np.float64]
    from soilml.physics.contact import Force

HELP = "forces and sinkage against slip and load, from a model"
DESCRIPTION = """\
Solve the equilibrium of gear and soil of MODEL.toml at every combination of
the slips and loads.

  soilml simulate MODEL.toml --slip 0:0.6:13 --load 60 --out curve.csv
  soilml simulate MODEL.toml --slip -0.3,0,0.3 --load 30:120:4 --run sim

Ranges are start:stop:count, or values with commas. With --run, `soilml
identify` can read the table. A row without equilibrium has blank values and
the reason in the column `status`; it is an error if no row has an equilibrium.
Without --out the table is printed, aligned on a terminal and as CSV into a
pipe.
"""
#: Rows that are simulated at a time.
BLOCK = 65536


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "model", type=InputFile, metavar="MODEL.toml", help="gear, soil and effects"
    )
    parser.add_argument(
        "--slip", required=True, help="slip ratios, above 0 driving, below 0 braking"
    )
    parser.add_argument("--load", required=True, help="vertical loads in N")
    parser.add_argument(
        "--speed", type=number, metavar="M_S", help="speed in m/s, below 0 in reverse"
    )
    parser.add_argument(
        "--pass", dest="passes", type=number, help="number of the pass: 1 on undisturbed soil"
    )
    parser.add_argument(
        "--slip-angle",
        type=number,
        metavar="RAD",
        help="angle between wheel plane and path, in rad",
    )
    add_effects_option(parser)
    add_gear_option(parser)
    parser.add_argument(
        "--run", dest="label", metavar="NAME", help="add a first column `run` with this name"
    )
    add_output(parser, "--out", "FILE.csv", "write the table to this file")


def run(args: argparse.Namespace) -> int:
    """Simulate and write the table."""
    import numpy as np

    from soilml.cli.options import MAX_ROWS, available_effects, parse_numbers
    from soilml.cli.output import write_columns
    from soilml.config.case import read_case_of_one_gear
    from soilml.fitting.covariance import ignored_discrepancy
    from soilml.io.table import fault_of_text
    from soilml.physics.operating_point import COVARIATES
    from soilml.row_status import Status

    case = read_case_of_one_gear(args.model, available_effects(args), args.gear)
    if args.label is not None and (fault := fault_of_text(args.label)):
        raise InputError(f"--run: {fault}")
    slips, loads = parse_numbers("--slip", args.slip), parse_numbers("--load", args.load)
    if slips.size * loads.size > MAX_ROWS:
        raise InputError(
            f"{slips.size} slips and {loads.size} loads are {slips.size * loads.size} rows; "
            f"at most {MAX_ROWS} are possible"
        )
    slip, load = (grid.ravel() for grid in np.meshgrid(slips, loads))
    covariates = {"speed": args.speed, "pass_number": args.passes, "slip_angle": args.slip_angle}
    force = _forces(case, slip, load, covariates)
    failed = int(np.count_nonzero(force.status))
    if failed == slip.size:
        worst = Status(int(force.status[0]))
        limit = f" (at most {force.load.max():.4g} N)" if worst is Status.TOO_HEAVY else ""
        raise InputError(
            f"no row has an equilibrium; {worst.reason}{limit}: change --load or the soil"
        )
    labels = {} if args.label is None else {"run": [args.label] * slip.size}
    write_columns(
        labels
        | {
            "slip": slip,
            "load_N": load,
            **{
                COVARIATES[field]: np.full(slip.size, value)
                for field, value in covariates.items()
                if value is not None
            },
            "torque_Nm": force.torque,
            "drawbar_pull_N": force.drawbar_pull,
            "sinkage_m": force.sinkage,
            "entry_angle_rad": force.entry_angle,
            "status": [Status(int(code)).reason for code in force.status],
        },
        args.out,
    )
    for line in ignored_discrepancy(case, "simulate", "the rows have no error of the model"):
        print(line, file=sys.stderr)
    if failed:
        print(
            f"{failed} of {slip.size} rows have no equilibrium: see the column status",
            file=sys.stderr,
        )
    return 0


def _forces(case: Case, slip: Floats, load: Floats, covariates: dict[str, float | None]) -> Force:
    """Forces (n,) at slips and loads (n,), in blocks, which bounds the memory."""
    from dataclasses import fields

    import numpy as np

    from soilml.cli.progress import progress_bar
    from soilml.physics.contact import Force
    from soilml.physics.operating_point import Operating

    parts = []
    with progress_bar(f"simulating {slip.size} rows", slip.size) as done:
        for first in range(0, slip.size, BLOCK):
            rows = slice(first, first + BLOCK)
            at = Operating(slip=slip[rows], load=load[rows], **covariates)
            parts.append(case.model(case.soil, at))
            done(min(rows.stop, slip.size))
    names = [f.name for f in fields(Force)]
    return Force(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})
