"""A map for logs that nobody has described, tried on them: `soilml import --init`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from soilml.log_import.guesses.map_guess import MapGuess
from soilml.log_import.readers.side_files import log_files
from soilml.log_import.wheel_rows import Progress
from soilml.log_import.workflow import read_logs, silent


@dataclass(frozen=True)
class DraftedMap:
    """A map as TOML with comments, how many of its lines are marked, and the evidence as text."""

    text: str
    marked: int
    evidence: str


def init_map(logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> str:
    """Look at logs and write a map with guesses, each with its reason, as TOML with comments.

    Guesses come from names, units and the behaviour of the values; checks of seconds of driving
    mark what they doubt. What no log shows, such as the radius, is marked with CHANGE or NEEDED.

    Raises `InputError` where a file cannot be read or has no columns.
    """
    return draft_map(logs).text


def draft_map(
    logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], progress: Progress = silent
) -> DraftedMap:
    """What `init_map` gives, with the number of lines that are marked."""
    recordings = read_logs(log_files(logs), progress)
    guess = MapGuess(recordings)
    found = guess.map()
    return DraftedMap(found.text, found.marked, guess.evidence)
