"""`soilml paper walk`: a wheel-leg walking over soft ground, by resistive-force theory."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from soilml.cli.options import OutputFile
from soilml.errors import InputError

if TYPE_CHECKING:
    from soilml.systems.wheel_legs.resistive_force import LinearGround

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Simulate wheel-legs by resistive-force theory (Li, Zhang and Goldman 2013;
Comin and Saaj 2017, eqs. 4 to 11), at every combination of feet, numbers of
legs, grounds and commanded slips.

  soilml paper walk --foot LTF,CIF --stiffness 0.4e6:1e6:4 --picture feet.png
  soilml paper walk --foot none --legs 1:6:6 --stiffness 0.7e6
  soilml paper walk --ground SSC-1,ES-3 --slip 0,0.25,0.5 --picture slips.png

Feet are none, LTF (Load Testing Foot), SRF and CIF (table III); grounds SSC-1,
SSC-2, SSC-3 and ES-3 (table I), or --stiffness, the stress in N/m^3 of depth
under a flat plate. A row has means, root mean squares and largest values over
the last full turn, and the sinkage at midstance. Without --slip the wheel
rolls freely. The picture shows the row's values against legs, stiffness or
slip, that of them which has three values or more.

The stress is proportional to the depth. Neighbouring legs do not act on each
other, and the body is a plate below the hub.
"""
ARGUMENTS = (
    ("--foot A,B,... (LTF)", "feet"),
    ("--legs N,... (5)", "numbers of legs, 1 to 6"),
    ("--ground A,B,...", "soils of table I (default: all four)"),
    ("--stiffness K,...", "stiffnesses in N/m^3, in place of --ground"),
    ("--slip S,...", "commanded slips; without it the wheel rolls freely"),
    ("--out FILE.csv", "write the table to this file", OutputFile),
    ("--picture FILE.png", "draw the values against legs, stiffness or slip", OutputFile),
)


def run(args: argparse.Namespace) -> int:
    """Simulate the walks and write the tables."""
    import numpy as np

    from soilml.cli.option_values import parse_names, parse_numbers
    from soilml.cli.output import tell, write_columns
    from soilml.cli.progress import working
    from soilml.systems.wheel_legs.walk import walk_picture, walk_table

    feet = parse_names(args.foot) or []
    counts = parse_numbers("--legs", args.legs)
    if np.any(counts != counts.round()):
        raise InputError(f"--legs is {args.legs!r}; needed are whole numbers")
    slips = [np.nan] if args.slip is None else parse_numbers("--slip", args.slip).tolist()
    for slip in slips:
        if abs(slip) >= 1.0:
            raise InputError(
                f"--slip is {slip:g}; needed is 1 - v/(r omega), between -1 and 1, not per cent"
            )
    with working("simulating the walks"):
        found = walk_table(feet, counts.astype(int).tolist(), _grounds(args), slips)
    drawn = None if args.picture is None else walk_picture(found)
    write_columns(found, args.out, args.picture, drawn)
    status = found["status"]
    for reason in dict.fromkeys(status[status != "ok"].tolist()):
        tell(f"{np.sum(status == reason)} of {status.size} walks: {reason}")
    return 0


def _grounds(args: argparse.Namespace) -> dict[str, LinearGround]:
    """The grounds of --ground or --stiffness, by name."""
    from soilml.cli.option_values import parse_names, parse_numbers
    from soilml.systems.wheel_legs.resistive_force import GROUNDS, LinearGround

    if args.stiffness is not None:
        if args.ground is not None:
            raise InputError("--stiffness is in place of --ground: give one of them")
        values = parse_numbers("--stiffness", args.stiffness).tolist()
        return {f"{value:g}": LinearGround(stiffness=value) for value in values}
    names = [name.upper() for name in parse_names(args.ground) or GROUNDS]
    if unknown := [name for name in names if name not in GROUNDS]:
        raise InputError(f"no ground {unknown[0]!r}; there are: {', '.join(GROUNDS)}")
    return {name: GROUNDS[name] for name in names}
