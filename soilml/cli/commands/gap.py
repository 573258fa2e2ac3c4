"""`soilml gap`: where a model and measurements disagree, and what the model lacks."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from soilml.cli.option_values import named_numbers
from soilml.cli.options import REPEATED, REQUIRED, folder_outputs
from soilml.errors import InputError
from soilml.io.atomic_files import write_files

if TYPE_CHECKING:
    from soilml.physics.effects.base import Effect

#: Files of the folder.
FILES = ("report.html", "gap.json", "model.toml", "next_runs.csv")
#: Exit status where the data cannot be analysed; the report is written and says why
BAD_DATA = 3
FORMATS = ("table", "json")
DESCRIPTION = """\
Compare MODEL.toml with measured runs. Where they disagree by more than noise
and run-to-run scatter, search for the missing effect, name it if the data
distinguish it from all others, add it to the model, and report how much of the
gap it closes.

  soilml gap MODEL.toml RUNS.csv --out FOLDER --holdout run
  soilml gap MODEL.toml RUNS.csv --out FOLDER --holdout load_N=150

--holdout keeps a quarter of the runs, or the rows with this value, for
validation. All rows of a run must come from one soil bed; one load per run is
best. Soil parameters without a prior are fixed at the model's values, and an
error in them appears as an effect.

RUNS.csv has the columns run, slip, load_N, torque_Nm, and optionally
drawbar_pull_N, sinkage_m, speed_m_s (below zero in reverse), pass,
slip_angle_rad, time_s and <column>_std. FOLDER receives report.html (start
here), gap.json, model.toml (the model with the missing effect, or all likely
explanations with their weights) and next_runs.csv (runs to measure next). The
exit status is 0 whatever the result, 3 where the data cannot be analysed, and
2 for bad input.

Runs of several wheels on one soil: write each as [gears.NAME] in MODEL.toml,
and name it in the column gear. An effect of one wheel is then grousers@NAME.

--checked torque-gain=0.003 declares the standard deviation of a sensor's fault
after calibration.
"""
ARGUMENTS = (
    "model-and-runs",
    ("--out FOLDER", "folder for the four files", REQUIRED),
    ("--holdout COLUMN=VALUE", "rows held out for validation, or `run` for a quarter of the runs"),
    "free",
    "seed",
    ("--checked EFFECT=STD", "std of a sensor's fault after calibration; can repeat", REPEATED),
    "rows",
    "effects",
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes, where their folder exists already."""
    return folder_outputs("--out", args.out, FILES)


def run(args: argparse.Namespace) -> int:
    """Analyse and write the four files."""
    from soilml.cli.option_values import parse_names
    from soilml.cli.options import available_effects
    from soilml.cli.output import origin_of, show_result, tell
    from soilml.cli.progress import progress_bar
    from soilml.cli.tables import print_table_hints, read_case_of_rows, read_rows
    from soilml.io.read_table import RUNS
    from soilml.optional_imports import need

    for library in ("scipy", "jinja2", "matplotlib"):
        need(library, "gap")
    from soilml.gap import gap
    from soilml.gap.report import gap_files

    table = read_rows(args, RUNS)
    effects = available_effects(args)
    case = read_case_of_rows(args, args.model, table, effects, with_explanations=True, several=True)
    print_table_hints(table, case)
    with progress_bar(f"analysing {len(table)} rows", 100) as done:
        report = gap(
            case,
            table,
            free=parse_names(args.free),
            holdout=args.holdout,
            effects=effects,
            calibration=_calibration(args.checked, effects),
            seed=args.seed,
            progress=lambda share: done(round(100 * share)),
        )
    texts = gap_files(report, str(args.model), str(args.runs), origin_of(args))
    folder = Path(args.out)
    files = {folder / name: text for name, text in texts.items()}
    write_files(files, folders=[folder])
    show_result(report.report(), report.as_json())
    tell(f"\n{', '.join(str(name) for name in files)}")
    return BAD_DATA if report.status == "bad-data" else 0


def _calibration(texts: list[str], effects: dict[str, type[Effect]]) -> dict[str, float]:
    kinds = sorted(n for n, e in effects.items() if e.about.kind in ("sensor", "rig"))
    found = named_numbers(texts, "--checked", "EFFECT=STD, as in torque-gain=0.003")
    for name, std in found.items():
        if name not in kinds:
            raise InputError(
                f"--checked {name!r}: needed is EFFECT=STD, with one of {', '.join(kinds)}"
            )
        if not 0.0 < std < float("inf"):
            raise InputError(
                f"--checked {name}={std:g}: the standard deviation must be a number above zero"
            )
    return found
