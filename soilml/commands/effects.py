"""`soilml effects`: the catalogue of effects."""

from __future__ import annotations

import argparse

from soilml.effects import EFFECTS
from soilml.effects.base import STAGES
from soilml.errors import InputError
from soilml.parameters import declared
from soilml.writing import aligned

HELP = "list the effects that a model can be given, or show one"
DESCRIPTION = """\
List the effects that [[effect]] in a model file may name.

  soilml effects                 all, a line each
  soilml effects slip-sinkage    one: parameters, units, bounds, equation, source
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("name", nargs="?", help="one effect")


def run(args: argparse.Namespace) -> int:
    """Print the catalogue or one entry."""
    if args.name is None:
        listed = [(name, ", ".join(declared(cls)), cls.about.text) for name, cls in EFFECTS.items()]
        print(aligned(("effect", "parameters", "what it is"), listed, text_columns=3))
        return 0
    if args.name not in EFFECTS:
        raise InputError(f"no effect {args.name!r}; there are: {', '.join(EFFECTS)}")
    cls = EFFECTS[args.name]
    acts = ", ".join(stage.removeprefix("on_") for stage in STAGES if hasattr(cls, stage))
    neutral = cls()
    rows = [
        (name, p.text, f"{getattr(neutral, name):g}", f"{p.lower:g} .. {p.upper:g}", p.unit)
        for name, p in declared(cls).items()
    ]
    print(f"{args.name}: {cls.about.text}\nacts on: {acts}\nsource: {cls.about.source}\n")
    print(aligned(("parameter", "what", "default", "bounds", "unit"), rows, text_columns=2))
    print(
        f"\n{_dedented(cls.__doc__ or '')}\n\nIn a model file:\n\n[[effect]]\nname = {args.name!r}"
    )
    for name, value in cls.about.reference.items():
        print(f"{name} = {value:g}")
    return 0


def _dedented(text: str) -> str:
    lines = text.strip().splitlines()
    return "\n".join([lines[0], *[line.removeprefix("    ") for line in lines[1:]]])
