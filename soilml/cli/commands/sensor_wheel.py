"""`soilml paper sensor-wheel`: shear modulus and drawbar pull from the stress on a rim."""

from __future__ import annotations

import argparse

from soilml.cli.option_values import NumberFrom, whole_number_from
from soilml.cli.options import InputFile, OutputFile
from soilml.errors import InputError

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Solve the force balance of each run of a wheel whose normal stress was
measured: k_x and M, the true over the measured stress. The k_x of one run, the
reference, then predicts drawbar pull and slope of all (Nagatani et al. 2009).

  soilml paper sensor-wheel MODEL.toml RUNS.csv --readings READINGS.csv
  soilml paper sensor-wheel MODEL.toml RUNS.csv --stress STRESS.csv \\
      --reference flat

MODEL.toml has the wheel and the soil: cohesion and friction angle are used,
and all of it for the pull by Bekker's stress, which stands beside. RUNS.csv
has a row for each run: run, slip, load_N (the weight on the wheel), slope_rad
(0 if absent), and optionally slip_std, load_N_std and slope_rad_std.

READINGS.csv has a row for each sample of each sensor over some turns: run,
angle_rad (from straight down, positive forward), sensor (1, 2, ...) and
force_N. They are averaged by angle, and the averaging over the sensor's disc
(--diameter) is removed. STRESS.csv in its place has run, angle_rad and
normal_Pa, optionally normal_Pa_std; its averaging is removed where --diameter
is given.

Standard deviations follow from the errors of stress, slip, weight and slope;
those of cohesion and friction angle are not included. The reference is the run
of least slope. One k_x serves up to a slip of about 0.5. The picture has k_x,
pull and slope (fig. 7 of the source) against slip. A whole rover with two such
wheels: soilml paper climb.
"""
ARGUMENTS = (
    ("model MODEL.toml", "the wheel, and the soil's strength", InputFile),
    ("runs RUNS.csv", "a row for each run", InputFile),
    ("--readings READINGS.csv", "samples of the sensors", InputFile),
    ("--stress STRESS.csv", "stress on the rim", InputFile),
    ("--reference RUN", "run whose k_x predicts the pulls"),
    "gear",
    ("--diameter M", "of round sensors, to remove their averaging", NumberFrom(1e-4, 1.0, "m")),
    ("--sensors N (4)", "number in the row", whole_number_from(1, 1000)),
    ("--out FILE.csv", "write the table to this file", OutputFile),
    ("--picture FILE.png", "draw k_x, pull and slope against slip", OutputFile),
    "report",
)


def run(args: argparse.Namespace) -> int:
    """Solve the balances and write the table."""
    from soilml.cli.output import deliver
    from soilml.config.case import read_case_of_one_gear
    from soilml.physics.effects import EFFECTS
    from soilml.physics.gears import Wheel
    from soilml.systems.rim_stress import SensingWheel, solve_runs
    from soilml.systems.rim_stress.tables import (
        read_readings,
        read_steady_runs,
        read_stresses,
    )

    if (args.readings is None) == (args.stress is None):
        raise InputError("give --readings or --stress, one of them")
    case = read_case_of_one_gear(args.model, EFFECTS, args.gear)
    gear, soil = case.model.gear, case.soil
    if not isinstance(gear, Wheel):
        raise InputError(f"{args.model}: the gear is of type {gear.name!r}; needed is 'wheel'")
    if case.model.effects:
        raise InputError(
            f"{args.model}: a measured stress has its effects in it; remove [[effect]]"
        )
    given = {} if args.diameter is None else {"diameter": args.diameter}
    size = {"radius": float(gear.radius), "width": float(gear.width)}
    wheel = SensingWheel(sensors=args.sensors, **size, **given)
    runs, discs = read_steady_runs(args.runs), args.readings is not None or bool(given)
    stresses = (
        read_stresses(args.stress, discs=wheel if discs else None)
        if args.readings is None
        else read_readings(args.readings, wheel)
    )
    found = solve_runs(runs, stresses, wheel, soil, args.reference, discs=discs, model=case.model)
    report = found.report(f"Pull of {args.model} from the stress on its rim")
    deliver(args, report, columns=found.columns)
    return 0
