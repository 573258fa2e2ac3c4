"""`soilml show effects`: the catalogue of effects."""

from __future__ import annotations

import argparse
import re
import textwrap

from soilml.cli.options import OPTIONAL
from soilml.errors import InputError, did_you_mean

DESCRIPTION = """\
List the effects that [[effect]] in a model file may name.

  soilml show effects                 all effects, one line each
  soilml show effects slip-sinkage    one effect: parameters, units, bounds,
                                 equation, source
"""
#: What replaces commands of LaTeX, in this order; inner braces go first.
_PLAIN = (
    (r"\\(left|right)(?![a-z])|\\[;,!]|\\q?quad *", ""),
    (r"\\tfrac(\d)(\d)", r"\1/\2"),
    (r"([\^_]|sqrt)\{([^{}]*)\}", r"\1(\2)"),
    (r"\\frac\{(\w+)\}", r"\1 / "),
    (r"\\frac\{([^{}]*)\}", r"(\1) / "),
    (r"/ \{(\w+)\}", r"/ \1"),
    (r"/ \{([^{}]*)\}", r"/ (\1)"),
    (r"\\text\{([^{}]*)\}", r"\1"),
    (r"\\leftarrow", "<-"),
    (r"\\var(?=phi)", r"\\"),
    (r"(?<=[a-z\d])\\(?=[a-z])", " "),
    (r"\\", ""),
)
ARGUMENTS = (
    ("name", "name of the effect to show", OPTIONAL),
    "effects",
)


def run(args: argparse.Namespace) -> int:
    """Print the catalogue or one entry."""
    from soilml.cli.options import available_effects
    from soilml.parameters import declared
    from soilml.physics.effects.base import STAGES
    from soilml.physics.operating_point import COVARIATES
    from soilml.report.aligned_text import format_table
    from soilml.report.numbers import shown_unit, significant

    effects = available_effects(args)
    if args.name is None:
        listed = [
            (name, cls.about.kind, cls.about.size, cls.about.text) for name, cls in effects.items()
        ]
        print(format_table(("effect", "of the", "size", "what it is"), listed, text_columns=4))
        return 0
    if args.name not in effects:
        raise InputError(
            f"no effect {args.name!r}; {did_you_mean(args.name, effects)}there are: "
            f"{', '.join(effects)}"
        )
    cls = effects[args.name]
    acts = ", ".join(stage.removeprefix("on_") for stage in STAGES if cls.overrides(stage))
    neutral = cls()
    rows = [
        (
            name,
            p.text,
            significant(factor * getattr(neutral, name)),
            f"{significant(factor * p.lower)} .. {significant(factor * p.upper)}",
            unit,
        )
        for name, p in declared(cls).items()
        for factor, unit in [shown_unit(p.unit)]
    ]
    about = cls.about
    print(f"{args.name}: {about.text}\nof the {about.kind}, acts on: {acts}")
    if about.needs:
        print(f"needs: {', '.join(COVARIATES[field] for field in about.needs)}")
    if about.family:
        print(f"family: {about.family}")
    if about.uses:
        print(f"uses, where known: {', '.join(COVARIATES[field] for field in about.uses)}")
    print(f"distinguished from others by: {about.isolate}\nsource: {about.source}\n")
    print(format_table(("parameter", "what", "default", "bounds", "unit"), rows, text_columns=2))
    print(f"\n{_plain(cls.__doc__ or '')}\n\nIn a model file:\n\n[[effect]]\nname = {args.name!r}")
    for name, value in cls.about.reference.items():
        print(f"{name} = {value:g}")  # in SI units, as a model file has it
    return 0


def _plain(docstring: str) -> str:
    """A docstring for a terminal: without its indentation, formulas in plain characters."""
    first, *more = docstring.strip().splitlines()
    text = "\n".join([first, *[line.removeprefix("    ") for line in more]])
    return re.sub(
        r"\.\. math::\s+(.+?)(?=\n\n\S|\Z)", lambda found: _formula(found[1]), text, flags=re.S
    )


def _formula(latex: str) -> str:
    r"""A formula of LaTeX in plain characters, indented.

    >>> _formula(r"\theta \leftarrow \frac{a}{1 - e^{-b}}, \quad m = \sqrt{n}")
    '    theta <- a / (1 - e^(-b)), m = sqrt(n)'
    """
    for pattern, by in _PLAIN:
        while latex != (latex := re.sub(pattern, by, latex)):
            pass
    return textwrap.indent("\n".join(line.strip() for line in latex.splitlines()), "    ")
