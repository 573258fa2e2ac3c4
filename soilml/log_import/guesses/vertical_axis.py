"""Columns whose names differ by an axis, and the place along the axis of the load: the sinkage.

Which of x, y and z is vertical is as somebody has set up the rig. The largest steady force shows
it (`forces`), and a place of the same letter is the height of the wheel, if it changes little.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

from soilml.log_import.guesses.columns import Candidate, words_of

#: Axis of a name, and number of a channel.
_AXIS, _NUMBER = re.compile(r"[xyz](?![a-z])", re.IGNORECASE), re.compile(r"\d+")
#: Words of a place in the world, whose vertical is the terrain's.
_OF_A_ROVER = {"odom", "odometry", "vo", "pose", "gps", "marker", "tracking"}
_OF_TRAVEL = 0.3  # Largest range of a sinkage, as a share of the travel
_NAMED, BY_AXIS = 4.5, 9.0  # Score of a name that says sinkage, and of a place by its axis
_OF_PLACES = ("position", "sinkage")


def families(candidates: Iterable[Candidate], numbers: bool = True) -> list[dict[str, Candidate]]:
    """Columns whose names differ by an axis, or a number, alone: by that text, the largest first.

    A family has two or three members; a column may be in several.
    """
    found: dict[tuple[str, str], dict[str, Candidate]] = {}
    for c in candidates:
        topic = c.address.removesuffix(c.name)
        for pattern in (_AXIS, _NUMBER) if numbers else (_AXIS,):
            for match in pattern.finditer(c.name):
                frame = f"{c.name[: match.start()]}\0{c.name[match.end() :]}".lower()
                found.setdefault((topic, frame), {})[match[0].lower()] = c
    return sorted((own for own in found.values() if 2 <= len(own) <= 3), key=len, reverse=True)


def axis_in(family: dict[str, Candidate], address: str) -> str:
    """The axis of a column in its family: x, y or z; "" where it is a number, or in no family."""
    own = [axis for axis, c in family.items() if c.address == address]
    return own[0] if own and own[0].isalpha() else ""


def with_sinkage_along(candidates: Sequence[Candidate], axis: str) -> tuple[list[Candidate], str]:
    """The candidates with the place along the vertical axis as the sinkage, and its address.

    They are as they were, and the address is "", where a name says which column is the sinkage, or
    no place along the axis changes as little as a sinkage does.
    """
    named = [c for c in candidates if c.scores.get("sinkage", 0.0) >= _NAMED and axis not in
             words_of(c.name)]  # fmt: skip
    places = [] if named else families(filter(_is_place, candidates), numbers=False)
    for family in places:
        own = family.get(axis)
        others = [c for letter, c in family.items() if letter != axis]
        if own is None or own.about.constant or not _is_small(own, others):
            continue
        new = {c.address: _of_travel(c, c is _farthest(others)) for c in others}
        new[own.address] = replace(own, scores={"sinkage": BY_AXIS})
        return [new.get(c.address, c) for c in candidates], own.address
    return list(candidates), ""


def is_vertical(candidate: Candidate) -> bool:
    """Whether `with_sinkage_along` has taken a column for the height of the wheel."""
    return candidate.scores == {"sinkage": BY_AXIS}


def _is_place(candidate: Candidate) -> bool:
    words = {*words_of(candidate.address)}
    if words & _OF_A_ROVER or candidate.kind not in (None, "m"):
        return False
    named = any(candidate.scores.get(role, 0.0) > 0.0 for role in _OF_PLACES)
    return candidate.kind == "m" or named or words <= {"x", "y", "z", "pos", "position"}


def _of_travel(candidate: Candidate, farthest: bool) -> Candidate:
    """A place across the vertical: no sinkage, and the travel where it goes farthest."""
    scores = {r: s for r, s in candidate.scores.items() if r != "sinkage"}
    if farthest:
        scores["position"] = max(scores.get("position", 0.0), _NAMED)
    return replace(candidate, scores=scores)


def _farthest(places: Sequence[Candidate]) -> Candidate:
    return max(places, key=lambda c: c.about.high - c.about.low)


def _is_small(own: Candidate, others: Sequence[Candidate]) -> bool:
    about = _farthest(others).about
    return own.about.high - own.about.low < _OF_TRAVEL * (about.high - about.low)
