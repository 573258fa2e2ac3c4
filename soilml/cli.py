"""The command `soilml`, whose sub-commands are found by entry points."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Sequence
from importlib.metadata import entry_points
from typing import Any, NoReturn

from soilml import __version__
from soilml.errors import SoilmlError

DESCRIPTION = """\
What soil does the rover drive on? From slip, torque and load to cohesion, friction angle and
shear modulus, with an uncertainty that can be believed.

  from a model to data        soilml simulate, generate
  from data to a flying file  soilml train
  from measurements to soil   soilml estimate (trained, on board), identify (analytic)
  which to believe            soilml compare
"""
EPILOG = "`soilml COMMAND --help` explains one command with an example."
ORDER = (
    "soils",
    "effects",
    "simulate",
    "identify",
    "audit",
    "gap",
    "generate",
    "train",
    "estimate",
    "compare",
)
_NEGATIVE = re.compile(r"-[\d.]")


class _Parser(argparse.ArgumentParser):
    """Says in one line what is wrong and where help is."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def parser() -> argparse.ArgumentParser:
    """The whole command line."""
    layout: Any = argparse.RawDescriptionHelpFormatter
    root = _Parser("soilml", description=DESCRIPTION, epilog=EPILOG, formatter_class=layout)
    root.add_argument("--version", action="version", version=f"soilml {__version__}")
    commands = root.add_subparsers(metavar="COMMAND", required=True)
    found = {entry.name: entry for entry in entry_points(group="soilml.commands")}
    for name in sorted(found, key=lambda n: (ORDER.index(n) if n in ORDER else 99, n)):
        module = found[name].load()
        sub = commands.add_parser(
            name,
            help=module.HELP,
            description=module.DESCRIPTION,
            formatter_class=layout,
        )
        module.add(sub)
        sub.set_defaults(run=module.run)
    return root


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 0 when it ran, 2 with one line on standard error for bad input."""
    given = _joined(list(sys.argv[1:] if arguments is None else arguments))
    args = parser().parse_args(given)
    try:
        return int(args.run(args) or 0)
    except SoilmlError as error:
        print(f"soilml: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("soilml: interrupted; nothing half-written was left", file=sys.stderr)
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _joined(words: list[str]) -> list[str]:
    """`--slip -0.3:0.6:10` as one word, which argparse would take for two options."""
    joined: list[str] = []
    for word in words:
        if joined and joined[-1] in ("--slip", "--load") and _NEGATIVE.match(word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined
