"""The columns of a place or of accelerations in x, y and z, found by the name of one of them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from soilml.log_import.guesses.columns.candidates import Candidate
from soilml.log_import.guesses.columns.column_words import words_of

#: Words of a place in the world, whose y may be constant where a rover drives straight.
_OF_A_ROVER = {"odom", "odometry", "vo", "pose", "gps", "marker", "tracking"}
_ACCELERATIONS = {"acc", "accel", "acceleration", "beschleunigung", "aceleracion", "aceleración"}
_ACCELERATIONS |= {"accelerazione", "accélération", "ax", "accx", "accelx", "xacc", "acx"}
_ORIENTATIONS = {"orientation", "quaternion", "quat", "attitude", "orientierung", "q", "qx"}
#: Gravity as accelerometers show it: g, m/s^2, mg; and how far from it a resting one may be.
_GRAVITY, _ABOUT = (1.0, 9.80665, 1000.0), 0.06
_X = re.compile(r"[xX]")


def axes_of(column: Candidate, candidates: Sequence[Candidate]) -> list[Candidate]:
    """The columns of x, y and, where there is one, z, of which `column` is x; else only itself.

    A rover drives in any direction, so that x alone is a share of its travel. Without y, z is no
    part of the place: it may be the sinkage of a gantry.
    """
    known = {candidate.address: candidate for candidate in candidates}
    for match in reversed(list(_X.finditer(column.address))):
        others = []
        for letter in "yz":
            own = letter if match[0] == "x" else letter.upper()
            address = column.address[: match.start()] + own + column.address[match.end() :]
            if address in known and not known[address].about.constant:
                others.append(known[address])
            elif letter == "y" and not (address in known and _OF_A_ROVER & {*words_of(address)}):
                break
        if others:
            return [column, *others]
    return [column]


def quaternion_of(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Four columns of a quaternion of unit length, x first; empty where there are none."""
    known = {candidate.address: candidate for candidate in candidates}
    for column in candidates:
        if not _ORIENTATIONS & {*words_of(column.address)} or column.address[-1:] not in "xX":
            continue
        letters = "yzw" if column.address.endswith("x") else "YZW"
        others = [known.get(column.address[:-1] + letter) for letter in letters]
        found = [column, *(other for other in others if other is not None)]
        if len(found) == 4 and abs(sum(c.about.middle**2 for c in found) - 1.0) < _ABOUT:
            return found
    return []


def accelerations_of(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Three columns of an accelerometer that shows gravity, x first; empty where there are none."""
    for candidate in candidates:
        if not _ACCELERATIONS & {*words_of(candidate.address)}:
            continue
        found = axes_of(candidate, candidates)
        size = math.sqrt(sum(c.about.middle**2 for c in found))
        if len(found) == 3 and any(abs(size / g - 1.0) < _ABOUT for g in _GRAVITY):
            return found
    return []
