"""Commands and options by their former names, which work in this version, with a hint."""

from __future__ import annotations

import sys
from collections.abc import Mapping

from soilml.errors import InputError

#: Former names of commands whose second word is not theirs.
_RENAMED = {
    "doctor": "setup check",
    "design": "plan wheels",
    "audit": "plan effects",
    "advise": "plan next",
    "design-runs": "plan runs",
    "papers": "paper numbers",
}
#: Former names of all commands.
COMMANDS = _RENAMED | {
    former: f"{group} {word}"
    for group, prefix, names in (
        ("show", "", "models soils effects"),
        ("setup", "", "completion"),
        ("drive", "", "slip map"),
        ("export", "export-", "c slip soil"),
        ("paper", "", "climb sensor-wheel wheel-leg walk"),
    )
    for word in names.split()
    for former in (prefix + word,)
}
#: Former names of options, by command.
OPTIONS: Mapping[str, Mapping[str, str]] = {
    "bevameter": {"--json": "--out"},
    "drive slip": {"--json": "--out"},
    "estimate": {"--case": "--model"},
    "export c": {"--rows": "--step-rows"},
    "export slip": {"--soils": "--draws"},
    "paper numbers": {"--json": "--out"},
    "plan next": {"--slips": "--slip", "--loads": "--load"},
}


def present_words(words: list[str]) -> list[str]:
    """The words of a command line with the present names.

    Raises `InputError` where a former option and its present name are both given.
    """
    if words and (name := COMMANDS.get(words[0])):
        _hint(f"`soilml {words[0]}` is now `soilml {name}`")
        words = [*name.split(), *words[1:]]
    former = next((OPTIONS[c] for n in (1, 2) if (c := " ".join(words[:n])) in OPTIONS), {})
    given = {word.partition("=")[0] for word in words}
    for old, new in former.items():
        if old not in given:
            continue
        if new in given or (new == "--out" and "-o" in given):
            raise InputError(f"{old} is now {new}, which is given too; run the command once each")
        _hint(f"{old} is now {new}")
    parts = (word.partition("=") for word in words)
    return [former.get(name, name) + equals + value for name, equals, value in parts]


def _hint(text: str) -> None:
    """Print a line on a terminal; a script that still uses a former name stays quiet."""
    if sys.stderr is not None and sys.stderr.isatty():
        print(f"! {text}", file=sys.stderr)
