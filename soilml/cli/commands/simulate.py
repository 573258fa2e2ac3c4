"""`soilml simulate`: forces on a running gear over slip and load."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilml.cli.effects_option import add_effects_option, chosen_effects
from soilml.cli.output import deliver
from soilml.config.case import read_case
from soilml.errors import InputError
from soilml.io.atomic_files import named
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.row_status import Status

#: Rows beyond which the table would not fit into the memory of a small machine.
MOST_ROWS = 10_000_000

HELP = "forces and sinkage over slip and load, from a model"
DESCRIPTION = """\
Solve the wheel-soil equilibrium of MODEL.toml at every slip and load given.

  soilml simulate MODEL.toml --slip 0:0.6:13 --load 60 --out curve.csv
  soilml simulate MODEL.toml --slip -0.3,0,0.3 --load 30:120:4 --run sim    identify can read this

Ranges are start:stop:count, or values with commas. A row without equilibrium has blank values and
its reason in `status`; where no row at all has one, that is an error. Without --out the table is
printed: aligned on a terminal, as CSV into a pipe.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", metavar="MODEL.toml", help="gear, soil and effects")
    parser.add_argument("--slip", required=True, help="slip ratios, driving above 0, braking below")
    parser.add_argument("--load", required=True, help="vertical loads, N")
    parser.add_argument("--speed", type=float, metavar="M_S", help="below zero in reverse")
    parser.add_argument("--pass", dest="passes", type=float, help="1 on virgin soil, 2 in a rut")
    parser.add_argument("--slip-angle", type=float, metavar="RAD", help="wheel out of its path")
    add_effects_option(parser)
    parser.add_argument(
        "--run", dest="label", metavar="NAME", help="put a column run with this name in front"
    )
    parser.add_argument("--out", metavar="FILE.csv", help="where to write the table")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return named(args.out, ".csv")


def run(args: argparse.Namespace) -> int:
    """Simulate and deliver the table."""
    case = read_case(args.model, chosen_effects(args))
    slips, loads = numbers("--slip", args.slip), numbers("--load", args.load)
    if slips.size * loads.size > MOST_ROWS:
        raise InputError(
            f"{slips.size} slips and {loads.size} loads are {slips.size * loads.size} rows; "
            f"at most {MOST_ROWS} are simulated at once"
        )
    slip, load = (grid.ravel() for grid in np.meshgrid(slips, loads))
    given = {"speed": args.speed, "pass_number": args.passes, "slip_angle": args.slip_angle}
    force = case.model(case.soil, Operating(slip=slip, load=load, **given))
    failed = int(np.count_nonzero(force.status))
    if failed == slip.size:
        worst = Status(int(force.status[0]))
        limit = f" (at most {force.load.max():.4g} N)" if worst is Status.TOO_HEAVY else ""
        raise InputError(f"no row has an answer; {worst.reason}{limit}: change --load or the soil")
    named = {} if args.label is None else {"run": [args.label] * slip.size}
    deliver(
        named
        | {
            "slip": slip,
            "load_N": load,
            **{
                COVARIATES[field]: np.full(slip.size, value)
                for field, value in given.items()
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
    if failed:
        print(f"{failed} of {slip.size} rows have no equilibrium: see status", file=sys.stderr)
    return 0


def numbers(option: str, text: str) -> NDArray[np.float64]:
    """The numbers of `start:stop:count` or `a,b,c`; raises `InputError` naming the option."""
    try:
        if ":" in text:
            start, stop, count = text.split(":")
            if int(count) > MOST_ROWS:
                raise InputError(f"{option} is {text!r}; at most {MOST_ROWS} values are taken")
            with np.errstate(all="ignore"):
                found = np.linspace(float(start), float(stop), int(count)).round(12)
        else:
            found = np.asarray([float(part) for part in text.split(",")])
    except InputError:
        raise
    except ValueError:
        found = np.zeros(0)
    if found.size == 0 or not np.all(np.isfinite(found)):
        shown = text if len(text) <= 80 else f"{text[:80]}..."
        raise InputError(f"{option} is {shown!r}; needed is start:stop:count or values with commas")
    return found
