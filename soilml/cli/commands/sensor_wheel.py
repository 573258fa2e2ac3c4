"""`soilml paper sensor-wheel`: shear modulus and drawbar pull from the stress on a rim."""

from __future__ import annotations

import argparse

from soilml.cli.options import (
    InputFile,
    NumberFrom,
    add_gear_option,
    add_output,
)
from soilml.errors import InputError, TableError

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Solve the force balance of each run of a wheel whose normal stress was measured:
k_x and M, the true over the measured stress. The k_x of one run, the
reference, then predicts the drawbar pull of all (Nagatani et al. 2009).

  soilml paper sensor-wheel MODEL.toml RUNS.csv --stress STRESS.csv
  soilml paper sensor-wheel MODEL.toml RUNS.csv --stress STRESS.csv --reference flat

MODEL.toml has the wheel (radius, width) and the soil, of which cohesion and
friction angle are used. RUNS.csv has a row for each run: run, slip, load_N (the
weight on the wheel), slope_rad (0 if absent), and optionally slip_std,
load_N_std and slope_rad_std. STRESS.csv has run, angle_rad (from straight down,
positive forward) and normal_Pa, optionally normal_Pa_std; without it the noise
of the stress is taken from its scatter. The standard deviations of k_x and of
the pull follow from these errors; those of cohesion and friction angle are not
included. The reference is the run of least slope. One k_x serves up to a slip
of about 0.5. pull_on_slope_N is the pull that the slope requires. --diameter
removes what a round sensor averages over its disc (0.0095 m in the source):
uncorrected, the arc appears longer and k_x too large. A whole rover with two
such wheels: soilml paper climb.
"""
#: Ratio of true to measured stress, or its inverse, that no loss of sensors explains.
MOST_MAGNIFICATION = 30.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "model", type=InputFile, metavar="MODEL.toml", help="the wheel, and the soil's strength"
    )
    parser.add_argument("runs", type=InputFile, metavar="RUNS.csv", help="a row for each run")
    parser.add_argument(
        "--stress", type=InputFile, metavar="STRESS.csv", required=True, help="stress on the rim"
    )
    parser.add_argument("--reference", metavar="RUN", help="run whose k_x predicts the pulls")
    add_gear_option(parser)
    parser.add_argument(
        "--diameter",
        type=NumberFrom(1e-4, 1.0, "m"),
        metavar="M",
        help="diameter of round sensors, whose averaging over the disc is removed",
    )
    add_output(parser, "--out", "FILE.csv", "write the table to this file")
    add_output(parser, "--picture", "FILE.png", "draw k_x and pull against slip")


def run(args: argparse.Namespace) -> int:
    """Solve the balances and write the table."""
    from dataclasses import replace

    import numpy as np

    from soilml.cli.output import tell, write_columns
    from soilml.config.case import read_case_of_one_gear
    from soilml.io.read_table import read_table
    from soilml.physics.effects import EFFECTS
    from soilml.physics.gears import Wheel
    from soilml.quantities import Z_90
    from soilml.report.column_panels import ColumnPanels
    from soilml.systems.force_sensor_wheel import MohrCoulomb, SensingWheel, SteadyRun
    from soilml.systems.force_sensor_wheel.runs_on_slopes import read_stresses, solve_runs

    case = read_case_of_one_gear(args.model, EFFECTS, args.gear)
    gear, soil = case.model.gear, case.soil
    if not isinstance(gear, Wheel):
        raise InputError(f"{args.model}: the gear is of type {gear.name!r}; needed is 'wheel'")
    if case.model.effects:
        raise InputError(
            f"{args.model}: a measured stress has its effects in it; remove [[effect]]"
        )
    need = ("run", "slip", "load_N")
    table = read_table(args.runs, need, filled=need)
    fields = {"slip": "slip", "weight": "load_N", "slope": "slope_rad"}
    runs = {}
    for name, rows in table.groups():
        if len(rows) > 1:
            raise TableError(f"{args.runs}: run {name} has {len(rows)} rows; needed is one")
        values = {
            f"{field}{std}": float(rows[f"{column}{std}"][0])
            for field, column in fields.items()
            for std in ("", "_std")
            if f"{column}{std}" in rows
        }
        runs[name] = SteadyRun(**values)
    need = ("run", "angle_rad", "normal_Pa")
    wheel = SensingWheel(radius=float(gear.radius), width=float(gear.width))
    discs = None if args.diameter is None else replace(wheel, diameter=args.diameter)
    found = solve_runs(
        runs,
        read_stresses(read_table(args.stress, need, filled=need), discs),
        wheel,
        MohrCoulomb(friction_angle=soil.friction_angle, cohesion=soil.cohesion),
        args.reference,
    )
    columns = {
        "run": list(found.runs),
        "slip": table["slip"],
        "shear_modulus_m": found.shear_modulus,
        "shear_modulus_m_std": found.shear_modulus_std,
        "magnification": found.magnification,
        "drawbar_pull_N": found.drawbar_pull,
        "drawbar_pull_N_std": found.drawbar_pull_std,
        "drawbar_pull_N_p05": found.drawbar_pull - Z_90 * found.drawbar_pull_std,
        "drawbar_pull_N_p95": found.drawbar_pull + Z_90 * found.drawbar_pull_std,
        "pull_on_slope_N": found.required,
    }
    panels = [("shear_modulus_m",), ("drawbar_pull_N", "pull_on_slope_N")]
    write_columns(columns, args.out, args.picture, ColumnPanels(columns, "slip", panels))
    middle = float(np.nanmedian(found.magnification))
    if not 1.0 / MOST_MAGNIFICATION < middle < MOST_MAGNIFICATION:
        tell(
            f"! the true stress is {middle:.3g} times the measured one: probably normal_Pa is in "
            f"{'kPa' if middle > 1.0 else 'another unit'}, or load_N is"
        )
    if discs is None:
        tell(
            "the stress is used as given: where round sensors averaged it over their disc, k_x is "
            "too large (by 14 % on the wheel of the source); --diameter removes that"
        )
    tell(f"drawbar_pull_N is predicted by k_x of run {found.reference}")
    for name, why in found.why.items():
        tell(f"run {name} has no k_x: {why}")
    return 0
