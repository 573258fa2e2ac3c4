"""`soilml effects`: the catalogue of effects."""

from __future__ import annotations

import argparse

from soilml.cli.options import add_effects_option

HELP = "list the effects that a model can include, or show one"
DESCRIPTION = """\
List the effects that [[effect]] in a model file may name.

  soilml effects                 all effects, one line each
  soilml effects slip-sinkage    one effect: parameters, units, bounds,
                                 equation, source
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("name", nargs="?", help="name of the effect to show")
    add_effects_option(parser)


def run(args: argparse.Namespace) -> int:
    """Print the catalogue or one entry."""
    from soilml.cli.execution.effects import run

    return run(args)
