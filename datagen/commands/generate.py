"""`soilml generate`: synthetic measured data from a recipe."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from soilml.cli.options import InputFile, add_effects_option
from soilml.io.atomic_files import output_files

HELP = "simulate measurements from a recipe, as a Parquet file"
DESCRIPTION = """\
Simulate the rover of RECIPE.toml and write what its sensors would measure,
with the true soil parameters in further columns.

  soilml generate recipe.toml data.parquet
  soilml generate wheel data.parquet --rows 20000 --seed 7

`wheel` is a packaged recipe, like wheel_test, wheel_leg and benchmark.

A recipe is a model file (see README) with rows and seed at the top, and

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
(kg), ...; or law = "line" alone. The same recipe and seed give the same bytes.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "recipe",
        type=InputFile,
        metavar="RECIPE.toml",
        help="recipe file, or the name of a packaged recipe",
    )
    parser.add_argument("out", metavar="OUT.parquet", help="file to write")
    parser.add_argument("--rows", type=int, help="number of rows (default: that of the recipe)")
    parser.add_argument(
        "--seed", type=int, help="seed of the random numbers (default: that of the recipe)"
    )
    add_effects_option(parser)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return output_files(args.out, ".parquet")


def run(args: argparse.Namespace) -> int:
    """Generate the file."""
    from soilml.optional_imports import need

    need("datagen.generate", "generate")
    from datagen.generate import generate
    from datagen.recipe import read_recipe
    from soilml.cli.option_values import available_effects
    from soilml.cli.progress import progress_bar
    from soilml.identification.discrepancy import ignored_discrepancy

    recipe = read_recipe(args.recipe, available_effects(args)).sized(args.rows, args.seed)
    with progress_bar("simulating", recipe.rows) as progress:
        result = generate(recipe, args.out, progress)
    consequence = (
        "errors of the model are neither in the rows nor in the intervals of files trained on them"
    )
    for line in ignored_discrepancy(recipe.case, "generate", consequence):
        print(line, file=sys.stderr)
    note = f", {result.failed} without equilibrium" if result.failed else ""
    print(f"{result.rows} rows{note} written to {args.out}", file=sys.stderr)
    return 0
