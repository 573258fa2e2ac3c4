"""`soilml export soil`: soil parameters for other simulators."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.option_values import whole_number_from
from soilml.cli.options import REQUIRED, InputFile, folder_outputs
from soilml.errors import InputError

DESCRIPTION = """\
Write the soil of FIT.json in the units and names of a simulator, with a README
of the equations, of what is ignored and of what no wheel test reveals.

  soilml identify MODEL.toml RUNS.csv --out result.json
  soilml export soil result.json --to chrono --out scm
  soilml export soil result.json --to chrono --out scm --draws 50
  soilml export soil MODEL.toml --to gazebo --out gazebo

FIT.json is the file that `soilml identify --out` wrote, or a model file.
Targets:
  chrono      Project Chrono, deformable terrain SCM
  gazebo      soil_params.yaml of gz-terramechanics

--draws N adds N soils of the posterior, a file each, for Monte Carlo runs. The
posterior is that of the methods averaged and posterior; of a model file, draws
are those of its priors. Parameters that rows cannot reveal, such as elastic_K
of Chrono, have a default that is named as such: replace it in the file.

FOLDER has the files, README.txt, and export.json with the remarks. A warning
says where one file hides that a parameter is not determined.
"""
ARGUMENTS = (
    ("fit FIT.json", "result of identify, or MODEL.toml", InputFile),
    ("--to TARGET", "chrono or gazebo", REQUIRED),
    ("--out FOLDER", "folder for the files", REQUIRED),
    ("--draws N (0)", "number of soils drawn from the posterior", whole_number_from(0)),
    "seed",
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files of the folder that every export has."""
    return folder_outputs("--out", args.out, ("README.txt", "export.json"))


def run(args: argparse.Namespace) -> int:
    """Write the folder and say what is in it."""
    from soilml.cli.output import show_result, tell
    from soilml.soil_export import export_soil

    if not args.out:
        raise InputError("--out is empty; needed is a folder")
    words = getattr(args, "command_line", [])
    export = export_soil(
        args.fit,
        args.to,
        args.out,
        draws=args.draws,
        seed=args.seed,
        words=words,
    )
    show_result(export.report(), {})
    tell(f"\nwritten to {args.out}; README.txt has the same with all details")
    return 0
