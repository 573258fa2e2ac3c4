"""`soilml setup completion`: completion of commands, options and names in a shell."""

from __future__ import annotations

import argparse

from soilml.cli.options import InputFile, leaves

DESCRIPTION = """\
Print a script with which a shell completes commands, options and file names.
For a shell, and for good:

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
    for _, command in leaves(root):
        for action in command._actions:
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
