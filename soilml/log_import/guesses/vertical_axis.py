"""Columns whose names differ by an axis, and the place along the axis of the load: the sinkage.

Which of x, y and z is vertical is as somebody has set up the rig. The largest steady force shows
it (`forces`), and a place of the same letter is the height of the wheel, if it changes little.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

from soilml.log_import.guesses.columns import Candidate, says, words_of

#: Axis of a name, and number of a channel.
_AXIS, _NUMBER = re.compile(r"[xyz](?![a-z])", re.IGNORECASE), re.compile(r"\d+")
#: Words of a place in the world, whose vertical is the terrain's.
OF_A_ROVER = {"odom", "odometry", "vo", "pose", "gps", "marker", "tracking"}
_OF_TRAVEL = 0.3  # Largest range of a sinkage, as a share of the travel
_NAMED, BY_AXIS = 4.5, 9.0  # Score of a name that says sinkage, and of a place by its axis


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
    return next((a for a, c in family.items() if c.address == address and a.isalpha()), "")


def with_sinkage_along(candidates: Sequence[Candidate], axis: str) -> tuple[list[Candidate], str]:
    """The candidates with the place along the vertical axis as the sinkage, and its address.

    They are as they were, and the address is "", where a name says which column is the sinkage, or
    no place along the axis changes as little as a sinkage does. Of the places across the vertical,
    the travel is that which goes farthest.
    """
    named = any(c.scores.get("sinkage", 0.0) >= _NAMED and axis not in words_of(c.name)
                for c in candidates)  # fmt: skip
    for family in families(filter(_is_place, candidates), numbers=False) if not named else ():
        own = family.get(axis)
        others = [c for letter, c in family.items() if letter != axis]
        farthest = max(others, key=lambda c: c.about.span)
        if own is None or own.about.constant or own.about.span >= _OF_TRAVEL * farthest.about.span:
            continue
        new = {own.address: replace(own, scores={"sinkage": BY_AXIS})}
        for c in others:
            scores = {r: s for r, s in c.scores.items() if r != "sinkage"}
            if c is farthest:
                scores["position"] = max(scores.get("position", 0.0), _NAMED)
            new[c.address] = replace(c, scores=scores)
        return [new.get(c.address, c) for c in candidates], own.address
    return list(candidates), ""


def is_vertical(candidate: Candidate) -> bool:
    """Whether `with_sinkage_along` has taken a column for the height of the wheel."""
    return candidate.scores == {"sinkage": BY_AXIS}


def _is_place(candidate: Candidate) -> bool:
    if says(candidate.address, OF_A_ROVER) or candidate.kind not in (None, "m"):
        return False
    named = any(candidate.scores.get(role, 0.0) > 0.0 for role in ("position", "sinkage"))
    plain = {*words_of(candidate.address)} <= {"x", "y", "z", "pos", "position"}
    return candidate.kind == "m" or named or plain
