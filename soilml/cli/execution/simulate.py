"""`soilml simulate`: forces on a running gear over slip and load."""

from __future__ import annotations

import argparse
import sys
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from soilml.cli.option_values import MAX_ROWS, available_effects, parse_numbers
from soilml.cli.output import write_columns
from soilml.cli.progress import progress_bar
from soilml.config.case import Case, read_case_of_one_gear
from soilml.errors import InputError
from soilml.fitting.declared_discrepancy import ignored_discrepancy
from soilml.io.table import fault_of_text
from soilml.physics.contact import Force
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.remarks import texts
from soilml.row_status import Status

Floats = NDArray[np.float64]

#: Rows that are simulated at a time.
BLOCK = 65536


def run(args: argparse.Namespace) -> int:
    """Simulate and write the table."""
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
    for line in texts(ignored_discrepancy(case, "simulate", "the rows have no error of the model")):
        print(line, file=sys.stderr)
    if failed:
        print(
            f"{failed} of {slip.size} rows have no equilibrium: see the column status",
            file=sys.stderr,
        )
    return 0


def _forces(case: Case, slip: Floats, load: Floats, covariates: dict[str, float | None]) -> Force:
    """Forces (n,) at slips and loads (n,), in blocks, which bounds the memory."""
    parts = []
    with progress_bar(f"simulating {slip.size} rows", slip.size) as done:
        for first in range(0, slip.size, BLOCK):
            rows = slice(first, first + BLOCK)
            at = Operating(slip=slip[rows], load=load[rows], **covariates)
            parts.append(case.model(case.soil, at))
            done(min(rows.stop, slip.size))
    names = [f.name for f in fields(Force)]
    return Force(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})
