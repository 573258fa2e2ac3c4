"""Which column is taken for which role, for one wheel or for several."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from soilml.log_import.guesses.columns import WHEEL_WORDS, Candidate, wheel_word, words_of
from soilml.log_import.guesses.vertical_axis import is_vertical

#: Words of a place in the world, whose y may be constant where a rover drives straight.
_OF_A_ROVER = {"odom", "odometry", "vo", "pose", "gps", "marker", "tracking"}
_ACCELERATIONS = {"acc", "accel", "acceleration", "beschleunigung", "aceleracion", "aceleración"}
_ACCELERATIONS |= {"accelerazione", "accélération", "ax", "accx", "accelx", "xacc", "acx"}
_ORIENTATIONS = {"orientation", "quaternion", "quat", "attitude", "orientierung", "q", "qx"}
#: Gravity as accelerometers show it: g, m/s^2, mg; and how far from it a resting one may be.
_GRAVITY, _ABOUT = (1.0, 9.80665, 1000.0), 0.06
_X = re.compile(r"[xX]")
#: Roles of which one suffices, the better one first where both fit as well.
_RIVALS = (
    ("rim_speed", "wheel_speed", "wheel_angle"),
    ("ground_speed", "position"),
    ("torque", "motor_current"),
)
_MEASURED = 3.0  # What a measured torque is worth over a current, whose constants no log shows
#: Roles that each wheel has of its own.
_PER_WHEEL = ("wheel_speed", "wheel_angle", "rim_speed", "torque", "motor_current", "load",
              "drawbar_pull", "sinkage", "slip")  # fmt: skip
#: Roles of one wheel that several columns may have together, and most of them.
_TOGETHER = {"load": 8, "drawbar_pull": 8, "sinkage": 4}
#: Lowest score of a guess.
_LEAST = 2.0
_AXLES = {"f": "front", "r": "rear", "b": "rear", "m": "middle", "c": "middle"}
#: Two letters in either order: fl, lf -> front, left.
_SIDES = {
    pair: (axle, side)
    for letter, axle in _AXLES.items()
    for short, side in (("l", "left"), ("r", "right"))
    for pair in (letter + short, short + letter)
}


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
            if address in known and is_vertical(known[address]):
                continue
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


@dataclass
class Assignment:
    """Columns by role: shared ones, those of each wheel, the runners-up, and further parts.

    Parts are y and z of a place, cells that carry one wheel together, sensors of one sinkage.
    """

    shared: dict[str, Candidate] = field(default_factory=dict)
    wheels: dict[str, dict[str, Candidate]] = field(default_factory=dict)
    others: dict[str, list[Candidate]] = field(default_factory=dict)
    parts: dict[str, list[Candidate]] = field(default_factory=dict)

    def roles(self) -> set[str]:
        """All roles that have a column."""
        return {*self.shared, *(role for own in self.wheels.values() for role in own)}


def assign(candidates: Sequence[Candidate]) -> Assignment:
    """Take the best column for each role, each column once."""
    found = Assignment()
    pairs = sorted(
        (
            (score, -i, role, candidate)
            for i, candidate in enumerate(candidates)
            for role, score in candidate.scores.items()
            if role != "time" and score >= _LEAST
        ),
        key=lambda p: (-p[0], -p[1]),
    )
    place = next((c for _, _, role, c in pairs if role == "position"), None)
    axes = axes_of(place, candidates)[1:] if place is not None else []
    taken = {candidate.address for candidate in axes}
    for _, _, role, candidate in pairs:
        if candidate.address in taken:
            continue
        if role not in found.shared:
            found.shared[role] = candidate
            taken.add(candidate.address)
        else:
            found.others.setdefault(role, []).append(candidate)
    for rivals in _RIVALS:
        present = [role for role in rivals if role in found.shared]
        best = max(present, key=lambda r: found.shared[r].scores[r] - 0.1 * rivals.index(r) +
                   (_MEASURED if r == "torque" else 0.0), default="")  # fmt: skip
        for role in present:
            if role != best:
                found.others.setdefault(role, []).insert(0, found.shared.pop(role))
    if axes and found.shared.get("position") is place:
        found.parts["position"] = axes
    _take_wheels(found)
    if not {"slope", "load"} & found.roles() and (
        angle := quaternion_of(candidates) or accelerations_of(candidates)
    ):
        # the load follows from the mass, on the slope that they show
        found.shared["slope"], found.parts["slope"] = angle[0], angle[1:]
    _leave_constant_speeds(found)
    if {"wheel_speed", "wheel_angle", "rim_speed"} & found.roles() and (
        {"ground_speed", "position"} & found.roles()
    ):
        # measured slip is better known than one that somebody has computed
        slip = found.shared.pop("slip", None)
        if slip is not None:
            found.others.setdefault("slip", []).insert(0, slip)
    return found


def _leave_constant_speeds(found: Assignment) -> None:
    """Where a speed never changes, a slip that does is taken: a sensor is dead, or nothing is.

    Simulated rigs write the speeds that they set, in which no sensor can be seen to live.
    """
    slip = found.shared.get("slip")
    speeds = [r for r in ("wheel_speed", "rim_speed", "ground_speed") if r in found.shared]
    if slip is None or slip.about.constant:
        return
    if any(found.shared[role].about.constant for role in speeds):
        for role in {*speeds, "position", "wheel_angle"} & found.shared.keys():
            found.others.setdefault(role, []).insert(0, found.shared.pop(role))


def _take_wheels(found: Assignment) -> None:
    """Move the roles of which several wheels have columns of one pattern to these wheels."""
    groups: dict[str, dict[str, Candidate]] = {}
    for role in _PER_WHEEL:
        if role not in found.shared:
            continue
        best = found.shared[role]
        if not wheel_word(best.address):
            continue
        alike = {wheel_name(best.address): best}
        for other in found.others.get(role, []):
            name = wheel_name(other.address)
            same = other.scores[role] >= best.scores[role] - 1.5 and _frame(other) == _frame(best)
            if name and same and name not in alike:
                alike[name] = other
        if len(alike) >= 2:
            groups[role] = alike
    if groups and groups.keys() <= {*_TOGETHER}:
        # nothing turns or drives for itself: cells and sensors of one wheel
        for role, alike in groups.items():
            _take_parts(found, role, list(alike.values()))
        return
    names = {name for alike in groups.values() for name in alike}
    complete = [n for n in sorted(names) if all(n in alike for alike in groups.values())]
    if len(complete) < 2:
        return
    for role, alike in groups.items():
        found.shared.pop(role)
        members = {candidate.address for candidate in alike.values()}
        found.others[role] = [c for c in found.others.get(role, []) if c.address not in members]
        for name in complete:
            found.wheels.setdefault(name, {})[role] = alike[name]


def _take_parts(found: Assignment, role: str, members: list[Candidate]) -> None:
    """Columns of one role whose names differ by a number or a place become one channel."""
    if not 2 <= len(members) <= _TOGETHER[role] or len({c.kind for c in members}) > 1:
        return
    first, *others = sorted(members, key=lambda c: c.address)
    found.shared[role], found.parts[role] = first, others
    addresses = {c.address for c in members}
    found.others[role] = [c for c in found.others.get(role, []) if c.address not in addresses]


def _frame(candidate: Candidate) -> tuple[str, ...]:
    """The words of a name without those of the wheel."""
    return tuple(word for word in words_of(candidate.address) if word not in WHEEL_WORDS)


def wheel_name(address: str) -> str:
    """Name of the wheel that a column belongs to: `front_left`, `wheel_3`; "" for none."""
    words = wheel_word(address)
    if not words:
        return ""
    plain = [side for word in words for side in _SIDES.get(word, (word,))]
    name = "_".join(dict.fromkeys(plain))
    return f"wheel_{name}" if name[0].isdigit() else name


def axle_of(wheel: str) -> str:
    """The axle that the name of a wheel says; "" where it says none."""
    for axle, words in (("front", ("front", "fl", "fr")), ("rear", ("rear", "back")),
                        ("middle", ("middle", "mid", "centre", "center"))):  # fmt: skip
        if any(word in wheel.split("_") for word in words):
            return axle
    return ""
