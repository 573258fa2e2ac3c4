"""`soilml generate`: synthetic measured data from a recipe."""

from __future__ import annotations

import argparse
import sys
from contextlib import nullcontext
from pathlib import Path

from soilml.cli.option_values import whole_number_from
from soilml.cli.options import InputFile
from soilml.errors import InputError
from soilml.io.atomic_files import output_files

DESCRIPTION = """\
Simulate the rover of RECIPE.toml and write what its sensors would measure,
with the true soil parameters in further columns.

  soilml generate recipe.toml data.parquet
  soilml generate wheel data.parquet --rows 20000 --seed 7

`wheel` is a packaged recipe, like wheel_test, wheel_leg and benchmark.

A recipe is a model file with rows and seed at the top, and

  [operating]                ranges of slip (ratio) and load (N)
  slip = [0.05, 0.6]
  load_N = [30, 120]

  [bias]                     sensor biases, one random value for each run
  torque_Nm = "1 %"

  [[runs]]                   rows measured on one soil, share of all rows
  rows = 8
  share = 1.0

[soil.prior] gives the ranges of the parameters that vary. [stick_slip] adds
the vibration of a wheel-leg: ranges of stiffness (N/m) and of drop (fraction
of the friction angle that sliding soil loses), turning (rad/s), foot_mass
(kg), ...; or law = "line" alone. [worlds] adds runs in which an effect acts
that the model lacks (effect = 0.4) or a smooth error (error = 0.5). The same
recipe and seed give the same bytes, on any number of processes (--workers).
"""


ARGUMENTS = (
    ("recipe RECIPE.toml", "recipe file, or the name of a packaged recipe", InputFile),
    ("out OUT.parquet", "file to write"),
    ("--rows N", "number of rows (default: that of the recipe)", whole_number_from(1)),
    ("--seed N", "of the random numbers (default: that of the recipe)", whole_number_from(0)),
    "workers",
    ("--device NAME", "solve by torch on this device, such as cuda; agrees to 1e-9"),
    "effects",
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The file that the command writes."""
    if args.device is not None and args.workers is not None:
        raise InputError("--device is solved on by one process: omit --workers")
    return output_files(args.out, ".parquet")


def run(args: argparse.Namespace) -> int:
    """Generate the file."""
    from soilml.optional_imports import need

    need("datagen.generate", "generate")
    from functools import partial

    from datagen.generate import generate
    from datagen.recipe import read_recipe
    from soilml.cli.options import available_effects
    from soilml.cli.output import tell
    from soilml.cli.progress import progress_bar
    from soilml.fitting.covariance import ignored_discrepancy
    from soilml.physics.computing_device import computing_on
    from soilml.processes import FORKS, process_map

    recipe = read_recipe(args.recipe, available_effects(args)).sized(args.rows, args.seed)
    if args.device is not None and recipe.case.simulator is not None:
        raise InputError("--device solves equations, and [simulator] has none: omit it")
    # effects of a file cannot be imported by processes that are spawned
    one = args.device is not None or (args.effects is not None and not FORKS)
    engine = partial(process_map, workers=1 if one else args.workers)
    on_device = nullcontext() if args.device is None else computing_on(args.device)
    with on_device, progress_bar("simulating", recipe.rows) as progress:
        failed = generate(recipe, args.out, progress, engine)
    consequence = (
        "errors of the model are neither in the rows nor in the intervals of files trained on them"
    )
    if recipe.case.simulator is None or recipe.case.simulator.states_discrepancy:
        for line in ignored_discrepancy(recipe.case, "generate", consequence):
            print(line, file=sys.stderr)
    if recipe.case.simulator is not None:
        text = "the error of the simulator's emulator is in the rows, one draw of it a run"
        print(text, file=sys.stderr)
    if (learned := recipe.case.remainder) is not None:
        what = f"[remainder] of {', '.join(learned.columns)}"
        print(f"{what} is in the rows: its mean, and one draw of its error a run", file=sys.stderr)
    note = f", {failed} without equilibrium" if failed else ""
    tell(f"{recipe.rows} rows{note} written to {args.out}")
    return 0
