"""`soilml plan wheels`: wheels of a rover for a slope, over soils and errors of the model."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from soilml.cli.option_values import NumberFrom, parse_names, whole_number_from
from soilml.cli.options import InputFile, OutputFile

if TYPE_CHECKING:
    from soilml.rover_design.study import DesignStudy

FORMATS = ("table", "json")
DESCRIPTION = """\
Find the wheels with which a rover climbs a slope: sizes within limits are
compared over the soils that it may meet and over typical errors of the model.

  soilml plan wheels ROVER.toml
  soilml plan wheels ROVER.toml --slope 20 --gravity moon --picture design.png
  soilml plan wheels ROVER.toml --soil ding2015/lunar_soil,mckay1994/jsc-1

ROVER.toml has [rover], [wheel], [soil] and [goal]; `soilml example design
FOLDER` writes one. No figure of the rover is assumed. A dimension is a number,
a range that is searched, or { values = [...] }. [goal] may also have margin,
torque_limit, energy_limit, slip_limit and risk; its `least` is a dimension,
energy or torque.

The best design meets the goal with the probability 1 - risk and has the least
of `least`; where none does, it is the likeliest. The margin is the largest
pull less the weight along the slope. The front has the designs that no other
one beats in both margin and `least`.
"""
ARGUMENTS = (
    ("study ROVER.toml", "rover, wheel, soil and goal", InputFile),
    ("--slope DEG", "slope in degrees", NumberFrom(0.0, 60.0, "degrees")),
    ("--gravity G", "gravity: earth, moon, mars, or in m/s^2"),
    ("--soil PAPER/SOIL,...", "published soils, each as likely"),
    ("--risk P", "probability of failing that is accepted", NumberFrom(0.001, 0.5)),
    ("--designs N (250)", "designs of the first round", whole_number_from(1, 100_000)),
    ("--draws N (1000)", "draws of soil and model error", whole_number_from(50, 20_000)),
    ("--out FILE.json", "write the result to this file", OutputFile),
    ("--picture FILE.png", "draw probability, margin and front of the designs", OutputFile),
    "report",
)


def run(args: argparse.Namespace) -> int:
    """Compare the designs and write the result."""
    from soilml.cli.output import deliver
    from soilml.cli.progress import stage_progress
    from soilml.optional_imports import need

    need("scipy", "plan wheels")
    from soilml.rover_design import design

    study = _study(args)
    with stage_progress() as progress:
        found = design(
            study,
            designs=args.designs,
            draws=args.draws,
            progress=progress,
        )
    report = found.report(f"Wheels for {Path(args.study).name}")
    deliver(args, report, found.as_json(), read=study.soil.files)
    return 0


def _study(args: argparse.Namespace) -> DesignStudy:
    """The question of the file, with what the options change."""
    import math
    from dataclasses import replace

    from soilml.config.wheeled_rover import read_gravity
    from soilml.rover_design.study import published_soils, read_study

    study = read_study(args.study)
    goal, soil = study.goal, study.soil
    if args.slope is not None:
        goal = replace(goal, slope=math.radians(args.slope))
    if args.risk is not None:
        goal = replace(goal, risk=args.risk)
    if (names := parse_names(args.soil)) is not None:
        soil = replace(published_soils(names), prior=soil.prior)
    gravity = study.gravity if args.gravity is None else read_gravity(args.gravity)
    return replace(study, goal=goal, soil=soil, gravity=gravity)
