"""`soilml climb`: the slope that a rover can climb, from its first climbs of gentle slopes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from soilml.cli.option_values import check_seed
from soilml.cli.output import is_terminal, json_text, show, write_stdout
from soilml.cli.output_names import CLIMB_FILES
from soilml.cli.progress import working
from soilml.cli.reports.report_files import origin_of, report_texts
from soilml.errors import InputError
from soilml.io.atomic_files import save_text, write_files
from soilml.io.text_tables import csv_text
from soilml.optional_imports import need

if TYPE_CHECKING:
    from soilml.systems.climbing.files.report import ClimbingReport


def run(args: argparse.Namespace) -> int:
    """Identify, predict and deliver."""
    from soilml.cli.reports.climb import climb_report, climb_text
    from soilml.systems.climbing.files.read_tables import read_climb_data
    from soilml.systems.climbing.files.report import climbing_report
    from soilml.systems.climbing.files.rover_file import read_rover

    check_seed(args)
    if args.slip_limit is not None and not 0.0 < args.slip_limit < 1.0:
        raise InputError(f"--slip-limit is {args.slip_limit:g}; needed is a slip from 0 to 1")
    folder = args.out is not None and not args.out.lower().endswith(".json")
    if folder:
        for library in ("jinja2", "matplotlib"):
            need(library, "climb")
    file = read_rover(args.rover)
    data = read_climb_data(args.runs, args.stress, file.stress, ignore_extra=args.ignore_extra)
    with working(f"identifying from {len(data.climbs)} climbs"):
        report = climbing_report(file, data, slip_limit=args.slip_limit, seed=args.seed)
    content = report.as_json()
    if args.out is None and not is_terminal():
        write_stdout(json_text(content))
        return 0
    if folder:
        page = climb_report(report, (args.rover, args.runs))
        html, result, curve, climbs = CLIMB_FILES
        target = Path(args.out)
        contents = report_texts(page, origin_of(args), content, (html, result), target)
        contents |= {target / curve: csv_text(_curve(report))}
        contents |= {target / climbs: csv_text(_runs(report))}
        write_files(contents, folders=[args.out])
    elif args.out is not None:
        save_text(args.out, json_text(content))
    show(climb_text(report))
    return 0


def _curve(report: ClimbingReport) -> dict[str, Any]:
    pull, slope = report.pull, report.slope
    return {
        "slip": report.ability.slip,
        "drawbar_pull_N": pull.middle,
        "drawbar_pull_N_p05": pull.lower,
        "drawbar_pull_N_p95": pull.upper,
        "slope_rad": slope.middle,
        "slope_rad_p05": slope.lower,
        "slope_rad_p95": slope.upper,
    }


def _runs(report: ClimbingReport) -> dict[str, Any]:
    from soilml.systems.climbing.files.report import SPEED_ERROR

    climbs = report.data.climbs
    return {
        "run": [c.name for c in climbs],
        "slope_rad": [c.slope for c in climbs],
        "slip_front": [c.front.slip for c in climbs],
        "slip_rear": [c.rear.slip for c in climbs],
        "off_N": report.ground.residual,
        "off_N_std": report.ground.residual_std,
        "shear_modulus_m_if_speed_low": report.modulus_per_climb[-SPEED_ERROR],
        "shear_modulus_m": report.modulus_per_climb[0.0],
        "shear_modulus_m_if_speed_high": report.modulus_per_climb[SPEED_ERROR],
    }
