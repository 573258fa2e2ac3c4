"""A map for logs that nobody has described, tried on them: `soilml import --init`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from soilml.errors import SoilmlError
from soilml.log_import.guesses.map_guess import MapGuess
from soilml.log_import.mapping.channel_map import ROLES
from soilml.log_import.mapping.log_map import map_from
from soilml.log_import.mapping.written_map import WrittenMap
from soilml.log_import.readers.side_files import log_files
from soilml.log_import.recording import Recording
from soilml.log_import.wheel_rows import Progress
from soilml.log_import.workflow import import_recordings, read_logs, silent
from soilml.quantities import COLUMNS

#: Remarks on rows that say that a column, a unit or a sign of the map is wrong.
_OF_MAPS = {
    "sign", "unit", "slip-unit", "slip-definition", "one-sensor", "rotation-too-fast",
    "travel-too-fast", "radius-as-diameter", "load-not-of-mass", "traction-out-of-range",
    "pull-out-of-range", "sinkage-out-of-range", "unit-of-another-kind", "slip-negative",
}  # fmt: skip


@dataclass(frozen=True)
class DraftedMap:
    """A map as TOML with comments, how many of its lines are marked, and the evidence as text."""

    text: str
    marked: int
    evidence: str


def init_map(logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> str:
    """Look at logs and write a map with guesses, each with its reason, as TOML with comments.

    Guesses come from names, units and the behaviour of the values. Where the map gives rows, their
    checks mark what they doubt. What no log shows, such as the radius, is marked with CHANGE or
    NEEDED.

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
    if doubts := _doubts(recordings, found):
        found = guess.map(doubts)
    return DraftedMap(found.text, found.marked, guess.evidence)


def _doubts(recordings: Sequence[Sequence[Recording]], guessed: WrittenMap) -> dict[str, str]:
    """What the rows of a new map say against its channels, by role; empty where it gives none."""
    try:
        found = import_recordings(recordings, map_from(guessed.content), accept=True)
    except SoilmlError:
        return {}
    doubts: dict[str, str] = {}
    for remark in (*found.implausible, *found.remarks):
        for name in remark.about if remark.code in _OF_MAPS else ():
            role = COLUMNS[name].name if name in COLUMNS else name
            if role in ROLES:
                said = remark.text.removeprefix("map: ").replace(f" in [{role}]", "")
                doubts.setdefault(role, said)
    return doubts
