"""`soilml completion`: completion of commands, options and names in a shell."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence

from soilml.errors import InputError

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
FILES = "<files>"
_BASH = """\
_soilml() {
    local word candidates IFS=$'\\n'
    candidates=$(soilml completion --candidates "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null)
    COMPREPLY=()
    for word in $candidates; do
        if [[ $word == '<files>' ]]; then
            compopt -o filenames 2>/dev/null
            COMPREPLY+=($(compgen -f -- "${COMP_WORDS[COMP_CWORD]}"))
        else
            COMPREPLY+=("$word")
        fi
    done
}
complete -F _soilml soilml
"""
_ZSH = """\
#compdef soilml
_soilml() {
    local -a candidates
    candidates=(${(f)"$(soilml completion --candidates "${(@)words[2,CURRENT]}" 2>/dev/null)"})
    if (( ${candidates[(I)<files>]} )); then
        candidates=(${candidates:#<files>})
        _files
    fi
    (( ${#candidates} )) && compadd -a candidates
}
if [ "$funcstack[1]" = "_soilml" ]; then _soilml "$@"; else compdef _soilml soilml; fi
"""
_FISH = """\
function __soilml_candidates
    set -l typed (commandline -opc) (commandline -ct)
    for word in (soilml completion --candidates $typed[2..-1] 2>/dev/null)
        if test "$word" = '<files>'
            __fish_complete_path (commandline -ct)
        else
            echo $word
        end
    end
end
complete -c soilml -f -a '(__soilml_candidates)'
"""
_SCRIPTS = {"bash": _BASH, "zsh": _ZSH, "fish": _FISH}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("shell", nargs="?", choices=SHELLS, help="bash, zsh or fish")
    parser.add_argument("--candidates", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)


def run(args: argparse.Namespace) -> int:
    """Print the script, or the candidates for the last of some words."""
    from soilml.cli.output import write_stdout

    if args.candidates is not None:
        found = candidates(args.make_parser, args.candidates or [""])
        write_stdout("".join(f"{word}\n" for word in found))
    elif args.shell is None:
        raise InputError(f"which shell? give one of {', '.join(_SCRIPTS)}")
    else:
        write_stdout(_SCRIPTS[args.shell])
    return 0


def candidates(
    make_parser: Callable[[str | None], argparse.ArgumentParser], words: Sequence[str]
) -> list[str]:
    """What the last word may become, after the words before it.

    make_parser: Gives the parser of a command, and of all without one; see
        `soilml.cli.main.parser`.
    words: Those after `soilml`; the last one is being typed, and may be empty.
    """
    *before, typed = words
    if not before:
        names = _commands(make_parser("--version"))
        return _beginning(typed, [*names, "--help", "--version"])
    known = _commands(make_parser(before[0]))
    if before[0] not in known:
        return []
    command, rest = known[before[0]], before[1:]
    options = {text: a for a in command._actions for text in a.option_strings}
    if rest and (pending := options.get(rest[-1])) is not None and pending.nargs != 0:
        return _values(pending, before[0], typed)
    if typed.startswith("-"):
        return _beginning(typed, sorted(text for text in options if text.startswith("--")))
    action = _positional(command, options, rest)
    return [] if action is None else _values(action, before[0], typed)


def _commands(root: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    for action in root._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


def _positional(
    command: argparse.ArgumentParser, options: dict[str, argparse.Action], words: Sequence[str]
) -> argparse.Action | None:
    """The positional argument that comes after these words."""
    count, takes_value = 0, False
    for word in words:
        if takes_value:
            takes_value = False
        elif word.startswith("--"):
            action = options.get(word)
            takes_value = action is not None and action.nargs != 0
        else:
            count += 1
    positional = [a for a in command._actions if not a.option_strings]
    if count < len(positional):
        return positional[count]
    return positional[-1] if positional and positional[-1].nargs in ("*", "+") else None


def _values(action: argparse.Action, command: str, typed: str) -> list[str]:
    """Values of an argument: its choices, known names, or files."""
    if action.choices is not None:
        return _beginning(typed, map(str, action.choices))
    metavar = str(action.metavar or action.dest)
    names = _named(command, action.dest, metavar)
    file = any(ending in metavar for ending in ("FILE", "LOG", "DIR", "FOLDER", ".")) or (
        getattr(action.type, "__name__", "") == "InputFile"
    )
    return [*_beginning(typed, names), *([FILES] if file else [])]


def _named(command: str, dest: str, metavar: str) -> Iterable[str]:
    """Names that are known for an argument."""
    if command == "soils" or dest == "soil":
        from soilml.physics.soils import soil_catalogue

        return soil_catalogue()
    if command == "effects" and dest == "name":
        from soilml.physics.effects import EFFECTS

        return EFFECTS
    if ".onnx" in metavar and "OUT" not in metavar:
        from soilml.onboard.model_file import released_models

        return released_models()
    if dest == "method":
        return ("nonlinear", "linear", "newton", "posterior")
    if dest == "gravity_law":
        from soilml.physics.soils.gravity_law import LAWS

        return LAWS
    if dest in ("gravity", "tested_at"):
        from soilml.config.wheeled_rover import GRAVITY

        return GRAVITY
    if dest == "rule":
        from soilml.onboard.multi_sensor import ACROSS_FILES

        return ACROSS_FILES
    return ("run", "gear") if dest == "by" else ()


def _beginning(typed: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith(typed)]
