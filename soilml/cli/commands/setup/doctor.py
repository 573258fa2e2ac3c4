"""`soilml doctor`: whether this installation works, and what it can do."""

from __future__ import annotations

import argparse

HELP = "check this installation: libraries, model files, output"
DESCRIPTION = """\
Check this installation: which libraries are present and in which version, what
cannot be done without the missing ones, and whether a released model file gives
its known answers on this machine. The exit status is 1 where something that the
installed parts need does not work.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""


def run(args: argparse.Namespace) -> int:
    """Print the findings."""
    from soilml.cli.execution.setup.doctor import run

    return run(args)
