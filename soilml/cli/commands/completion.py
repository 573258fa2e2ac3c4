"""`soilml setup completion`: completion of commands, options and names in a shell."""

from __future__ import annotations

import argparse
from collections.abc import Iterable

from soilml.cli.options import leaves

DESCRIPTION = """\
Print a script with which a shell completes commands, options, soils, effects,
released model files and file names. For a shell, and for good:

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
    for name, command in leaves(root):
        for action in command._actions:
            if action.choices is None and action.nargs != 0:
                _complete(action, name)
    write_stdout(shtab.complete(root, args.shell))
    return 0


def _complete(action: argparse.Action, command: str) -> None:
    """Declare for shtab what an argument may be: known names, files, or both."""
    from shtab import FILE

    metavar = str(action.metavar or action.dest)
    names = " ".join(_names(command, action.dest, metavar))
    file = any(
        ending in metavar.replace("...", "") for ending in ("FILE", "LOG", "FOLDER", ".")
    ) or (getattr(action.type, "__name__", "") == "InputFile")
    if file and names:
        function = f"_soilml_{command}_{action.dest}".replace("-", "_").replace(" ", "_")
        action.complete = {  # type: ignore[attr-defined]
            "bash": function,
            "zsh": f"{{compadd {names}; _files}}",
            "fish": f"(printf '%s\\n' {names}; __fish_complete_path (commandline -ct))",
            "preamble": {
                "bash": f'{function}() {{ compgen -W "{names}" -- "$1"; compgen -f -- "$1"; }}'
            },
        }
    elif file:
        action.complete = FILE  # type: ignore[attr-defined]
    elif names:
        action.choices = names.split()


def _names(command: str, dest: str, metavar: str) -> Iterable[str]:
    """Names that are known for an argument."""
    from soilml.config.wheeled_rover import GRAVITY
    from soilml.identification import METHODS
    from soilml.onboard.model_file import released_models
    from soilml.physics.effects import EFFECTS
    from soilml.physics.soils import soil_catalogue
    from soilml.physics.soils.gravity_law import LAWS

    if ".onnx" in metavar and "OUT" not in metavar:
        return released_models()
    known: dict[str, Iterable[str]] = {
        "show soils name": soil_catalogue(),
        "show effects name": EFFECTS,
        "soil": soil_catalogue(),
        "method": METHODS,
        "gravity_law": LAWS,
        "gravity": GRAVITY,
        "tested_at": GRAVITY,
        "by": ("run", "gear"),
    }
    return known.get(dest) or known.get(f"{command} {dest}", ())
