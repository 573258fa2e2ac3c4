"""`soilml generate`: synthetic measured data from a recipe."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from soilml.cli.effects_option import add_effects_option, chosen_effects
from soilml.io.atomic_files import named

HELP = "synthetic measurements from a recipe, as Parquet"
DESCRIPTION = """\
Simulate RECIPE.toml and write what the rover's sensors would report, with the true soil beside it.

  soilml generate recipe.toml data.parquet
  soilml generate wheel data.parquet --rows 20000 --seed 7    a recipe of the package

A recipe is a model file (see README) with, at the top, rows and seed, and

  [operating]             [bias]                    [[runs]]
  slip = [0.05, 0.6]      torque_Nm = "1 %"         rows = 8      # rows on one soil
  load_N = [30, 120]      # one draw for each run   share = 1.0   # of all rows

[soil.prior] says which parameters vary, and where. [stick_slip] adds the vibration of a wheel-leg:
ranges of stiffness (N/m) and of drop (share of the friction angle that sliding soil loses), turning
(rad/s), foot_mass, ...; or law = "line" alone. Same recipe and seed, same bytes.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("recipe", metavar="RECIPE.toml", help="or the name of a packaged recipe")
    parser.add_argument("out", metavar="OUT.parquet")
    parser.add_argument("--rows", type=int, help="how many, instead of the recipe's")
    parser.add_argument("--seed", type=int, help="instead of the recipe's")
    add_effects_option(parser)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return named(args.out, ".parquet")


def run(args: argparse.Namespace) -> int:
    """Generate the file."""
    from soilml.optional_imports import need

    need("datagen.generate", "generate")
    from datagen.generate import generate
    from datagen.recipe import read_recipe
    from soilml.cli.progress import bar

    recipe = read_recipe(args.recipe, chosen_effects(args)).sized(args.rows, args.seed)
    with bar("simulating", recipe.rows) as progress:
        made = generate(recipe, args.out, progress)
    note = f", {made.failed} without equilibrium" if made.failed else ""
    print(f"{made.rows} rows{note} written to {args.out}", file=sys.stderr)
    return 0
