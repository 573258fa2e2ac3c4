"""`soilml completion`: completion of commands, options and names in a shell."""

from __future__ import annotations

import argparse

HELP = "completion for bash, zsh or fish"
DESCRIPTION = """\
Print a script with which a shell completes commands, options, soils, effects,
released model files and file names. For a shell, and for good:

  source <(soilml completion bash)             # or zsh
  soilml completion fish | source

  soilml completion bash > ~/.local/share/bash-completion/completions/soilml
  soilml completion zsh  > ~/.zfunc/_soilml    # a folder of fpath, before compinit
  soilml completion fish > ~/.config/fish/completions/soilml.fish
"""
SHELLS = ("bash", "zsh", "fish")


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("shell", nargs="?", choices=SHELLS, help="bash, zsh or fish")
    parser.add_argument("--candidates", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)


def run(args: argparse.Namespace) -> int:
    """Print the script, or the candidates for the last of some words."""
    from soilml.cli.execution.setup.completion import run

    return run(args)
