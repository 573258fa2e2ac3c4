"""What commands that read a model file share: effects of the user's own."""

from __future__ import annotations

import argparse

from soilml.physics.effects import EFFECTS, Effect


def add_effects_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--effects`."""
    parser.add_argument(
        "--effects",
        metavar="FILE.py",
        help="effects of your own that [[effect]] may name; the file is run",
    )


def chosen_effects(args: argparse.Namespace) -> dict[str, type[Effect]]:
    """The catalogue, with the user's own effects where a file of them is given."""
    if args.effects is None:
        return dict(EFFECTS)
    from soilml.physics.effects.user_effects import load_effects

    return {**EFFECTS, **load_effects(args.effects)}
