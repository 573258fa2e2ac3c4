"""`soilml models`: the released model files."""

from __future__ import annotations

import argparse

HELP = "list the released model files, which `estimate` takes by their short names"
DESCRIPTION = """\
List the released model files of this installation. A short name stands for the
file wherever a command reads a model file:

  soilml models                     all files, one line each
  soilml estimate wheel             what one file is for
  soilml estimate wheel RUNS.csv    estimates by it
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""


def run(args: argparse.Namespace) -> int:
    """Print the list."""
    from soilml.cli.execution.setup.models import run

    return run(args)
