"""`soilml setup completion`: completion of commands, options and names in a shell."""

from __future__ import annotations

import argparse
from collections.abc import Iterable

from soilml.cli.options import InputFile, leaves

DESCRIPTION = """\
Print a script with which a shell completes commands, options, soils, effects
and file names. For a shell, and for good:

  eval "$(soilml setup completion bash)"             # or zsh
  soilml setup completion fish | source

  soilml setup completion bash \\
      > ~/.local/share/bash-completion/completions/soilml
  soilml setup completion zsh > ~/.zfunc/_soilml     # in fpath, before compinit
  soilml setup completion fish > ~/.config/fish/completions/soilml.fish

Print it again after an update of soilml, which may have other commands.
"""
ARGUMENTS = (("shell", "bash, zsh or fish", {"choices": ("bash", "zsh", "fish")}),)


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    from soilml.cli.output import write_stdout
    from soilml.optional_imports import need

    need("shtab", "setup completion")
    import shtab

    root = args.make_parser()
    for action in root._actions:  # shtab leaves out what the help leaves out
        if action.metavar == "COMMAND":
            action.help = "command"
    known = _names()
    for name, command in leaves(root):
        for action in command._actions:
            if action.choices is None:
                action.choices = known.get(f"{name} {action.dest}") or known.get(action.dest)
            if action.choices is None and _is_file(action):
                action.complete = shtab.FILE
    write_stdout(shtab.complete(root, args.shell))
    return 0


def _is_file(action: argparse.Action) -> bool:
    """Whether an argument is the name of a file or a folder, which its metavar tells."""
    metavar = str(action.metavar or "").replace("...", "")
    return action.type is InputFile or any(
        part in metavar for part in ("FILE", "LOG", "FOLDER", ".")
    )


def _names() -> dict[str, Iterable[str]]:
    """Names that are known, by argument, or by command and argument."""
    from soilml.config.wheeled_rover import GRAVITY
    from soilml.identification import METHODS
    from soilml.physics.effects import EFFECTS
    from soilml.physics.soils import soil_catalogue
    from soilml.physics.soils.gravity_law import LAWS

    return {
        "show name": [*soil_catalogue(), *EFFECTS],
        "soil": list(soil_catalogue()),
        "method": list(METHODS),
        "gravity_law": list(LAWS),
        "gravity": list(GRAVITY),
        "tested_at": list(GRAVITY),
        "by": ["run", "gear"],
    }
