"""Commands and options by their former names, which work in this version, with a hint."""

from __future__ import annotations

import sys
from collections.abc import Mapping

from soilml.errors import InputError

#: Former names of commands.
COMMANDS = {
    "models": "show models",
    "soils": "show soils",
    "effects": "show effects",
    "doctor": "setup check",
    "completion": "setup completion",
    "slip": "drive slip",
    "map": "drive map",
    "design": "plan wheels",
    "audit": "plan effects",
    "advise": "plan next",
    "design-runs": "plan runs",
    "export-c": "export c",
    "export-fusion": "export fusion",
    "export-step": "export step",
    "export-slip": "export slip",
    "export-soil": "export soil",
    "climb": "paper climb",
    "sensor-wheel": "paper sensor-wheel",
    "wheel-leg": "paper wheel-leg",
    "walk": "paper walk",
    "papers": "paper numbers",
}
#: Former names of options, by command.
OPTIONS: Mapping[str, Mapping[str, str]] = {
    "adapt": {"--soil": "--truth"},
    "bevameter": {"--json": "--out"},
    "drive slip": {"--json": "--out"},
    "estimate": {"--case": "--model"},
    "export c": {"--rows": "--step-rows"},
    "export slip": {"--soils": "--draws"},
    "export soil": {"--run": "--group"},
    "export step": {"--rows": "--step-rows"},
    "paper numbers": {"--json": "--out"},
    "paper walk": {"--speed": "--angular-speed"},
    "plan next": {"--slips": "--slip", "--loads": "--load", "--radii": "--radius"},
}
#: Options whose value is the first argument now.
FIRST = {"drive slip": "--rover", "drive map": "--rover"}


def present_words(words: list[str]) -> list[str]:
    """The words of a command line with the present names.

    Raises `InputError` where a former option and its present name are both given.
    """
    name = COMMANDS.get(words[0], "") if words else ""
    found = [*name.split(), *words[1:]] if name else list(words)
    if name:
        _hint(f"`soilml {words[0]}` is now `soilml {name}`")
    length = 1 if found[:1] and found[0] in {*OPTIONS, *FIRST} else 2
    command, rest = " ".join(found[:length]), found[length:]
    for old, new in OPTIONS.get(command, {}).items():
        rest = _renamed(rest, old, new)
    if (first := FIRST.get(command)) is not None:
        rest = _moved(rest, first)
    if command == "export fusion" and len(rest) > 1 and rest[0].endswith(".c"):
        rest = [*rest[1:], rest[0]]
        _hint("the C file is now the last argument: soilml export fusion MODEL.onnx ... OUT.c")
    return [*found[:length], *rest]


def _renamed(words: list[str], old: str, new: str) -> list[str]:
    """The words with another name of an option."""
    given = [word.partition("=")[0] for word in words]
    if old not in given:
        return words
    if new in given or (new == "--out" and "-o" in given):
        raise InputError(f"{old} is now {new}, which is given too; run the command once for each")
    _hint(f"{old} is now {new}")
    return [
        new + word[len(old) :] if name == old else word
        for name, word in zip(given, words, strict=True)
    ]


def _moved(words: list[str], option: str) -> list[str]:
    """The words with the value of an option as the first argument."""
    for i, word in enumerate(words):
        if word == option and i + 1 < len(words):
            _hint(f"{option} is now the first argument")
            return [words[i + 1], *words[:i], *words[i + 2 :]]
        if word.startswith(f"{option}="):
            _hint(f"{option} is now the first argument")
            return [word.partition("=")[2], *words[:i], *words[i + 1 :]]
    return words


def _hint(text: str) -> None:
    """Print a line on a terminal; a script that still uses a former name stays quiet."""
    if sys.stderr is not None and sys.stderr.isatty():
        print(f"! {text}", file=sys.stderr)
