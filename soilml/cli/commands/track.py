"""`soilml paper track`: from the log of a tracked robot's pulls to the soil and its figures."""

from __future__ import annotations

import argparse

from soilml.cli.option_values import NumberFrom
from soilml.cli.options import REQUIRED, InputFile, OutputFile
from soilml.errors import InputError

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Evaluate the log of a tracked robot that pulls a payload (Wang, Yan and Du
2018): slip from two travels, pull from the stationary part of the tension,
sinkage of the rear wheel from two lasers; fit the free parameters of the soil
to the pulls.

  soilml paper track MODEL.toml LOG.csv --mass 130 --spacing 0.6
  soilml paper track MODEL.toml LOG.csv --mass 130 --grousers 0.05,0.01,0.97,0.1

MODEL.toml has the track, the soil, and [soil.prior] for what is to be fitted.
LOG.csv has rows of run, belt_travel_m, travel_m (both m since the start) and
tension_N, of both tracks; and front_laser_m, rear_laser_m and inclination_rad
(tail down) where they were measured, --spacing apart. Its rows are evenly
spaced in time.

A row of the output is a run: slip, pull of one track, sinkage, what the model
predicts of them, and the angles at which the belt meets and leaves the soil
(fig. 8). The picture has these; the page of --report has the line of the belt
(fig. 7) too. --grousers adds the pull of discrete grousers (eqs. 10 to 14),
with f_g, the friction of soil that has yielded, as an input: the paper does
not print it.
"""
ARGUMENTS = (
    ("model MODEL.toml", "track, soil and its priors", InputFile),
    ("runs LOG.csv", "the log", InputFile),
    ("--mass KG", "of the robot", NumberFrom(0.01, 1e5, "kg"), REQUIRED),
    ("--spacing M", "between the lasers", NumberFrom(0.01, 100.0, "m")),
    ("--grousers PITCH,TIP,FG,JK", "pitch and tip (m), f_g, and j_k (m)"),
    "gear",
    ("--out FILE.csv", "write the table to this file", OutputFile),
    ("--picture FILE.png", "draw pull, sinkage and angles", OutputFile),
    "report",
)


def run(args: argparse.Namespace) -> int:
    """Evaluate the log and write the table."""
    from soilml.cli.option_values import parse_numbers
    from soilml.cli.output import deliver
    from soilml.config.case import read_case_of_one_gear
    from soilml.io.read_table import read_table
    from soilml.physics.effects import EFFECTS
    from soilml.systems.tracked_robot import DiscreteGrousers
    from soilml.systems.tracked_robot.track_log import LOG, evaluate_log

    case = read_case_of_one_gear(args.model, EFFECTS, args.gear)
    log = read_table(args.runs, LOG, filled=LOG)
    grousers = None
    if args.grousers is not None:
        sizes = parse_numbers("--grousers", args.grousers).tolist()
        if len(sizes) != 4:
            raise InputError(f"--grousers is {args.grousers!r}; needed are pitch, tip, f_g and j_k")
        pitch, tip, friction, yielding = sizes
        grousers = DiscreteGrousers(pitch=pitch, tip=tip, friction=friction, yielding=yielding)
    found = evaluate_log(case, log, 0.5 * args.mass * 9.81, args.spacing, grousers)
    deliver(args, found.report(), columns=found.columns)
    return 0
