"""Which column is taken for which role, for one wheel or for several."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from soilml.log_import.guesses.columns import WHEEL_WORDS, Candidate, says, wheel_word, words_of
from soilml.log_import.guesses.forces import OF_A_ROVER, is_vertical

_ACCELERATIONS = words_of(
    "acc accel acceleration beschleunigung aceleracion aceleración accelerazione accélération ax"
    " accx accelx xacc acx"
)
_ORIENTATIONS = {"orientation", "quaternion", "quat", "attitude", "orientierung", "q", "qx"}
#: Gravity as accelerometers show it: g, m/s^2, mg; and how far from it a resting one may be.
_GRAVITY, _ABOUT = (1.0, 9.80665, 1000.0), 0.06
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
    part of the place: it may be the sinkage of a gantry. Where a rover drives straight, y may be
    constant.
    """
    known = {candidate.address: candidate for candidate in candidates}
    for match in reversed(list(re.finditer("[xX]", column.address))):
        others = []
        for letter in "yz" if match[0] == "x" else "YZ":
            own = known.get(
                column.address[: match.start()] + letter + column.address[match.end() :]
            )
            if own is not None and is_vertical(own):
                continue
            if own is not None and not own.about.constant:
                others.append(own)
            elif letter in "yY" and not (own is not None and says(own.address, OF_A_ROVER)):
                break
        if others:
            return [column, *others]
    return [column]


def angle_of(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Four columns of a quaternion of unit length, x first, or three of an accelerometer that shows
    gravity; empty where there are none.
    """
    known = {candidate.address: candidate for candidate in candidates}
    for column in candidates:
        if says(column.address, _ORIENTATIONS) and column.address[-1:] in ("x", "X"):
            letters = "yzw" if column.address.endswith("x") else "YZW"
            others = (known.get(column.address[:-1] + letter) for letter in letters)
            found = [column, *(other for other in others if other is not None)]
            if len(found) == 4 and abs(_size(found) - 1.0) < _ABOUT / 2.0:
                return found
    for column in candidates:
        if says(column.address, _ACCELERATIONS):
            found = axes_of(column, candidates)
            if len(found) == 3 and any(abs(_size(found) / g - 1.0) < _ABOUT for g in _GRAVITY):
                return found
    return []


def _size(columns: Sequence[Candidate]) -> float:
    return math.hypot(*(c.about.middle for c in columns))


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

    def leave(self, roles: Iterable[str]) -> None:
        """Take columns of these roles for the first of the runners-up."""
        for role in roles:
            if role in self.shared:
                self.others.setdefault(role, []).insert(0, self.shared.pop(role))

    def move(self, role: str, members: Iterable[Candidate]) -> None:
        """Take columns out of the runners-up."""
        addresses = {c.address for c in members}
        self.others[role] = [c for c in self.others.get(role, []) if c.address not in addresses]


def assign(candidates: Sequence[Candidate]) -> Assignment:
    """Take the best column for each role, each column once."""
    found = Assignment()
    pairs = [
        (score, role, candidate)
        for candidate in candidates
        for role, score in candidate.scores.items() if role != "time" and score >= _LEAST
    ]  # fmt: skip
    pairs.sort(key=lambda p: -p[0])
    place = next((c for _, role, c in pairs if role == "position"), None)
    axes = axes_of(place, candidates)[1:] if place is not None else []
    taken = {candidate.address for candidate in axes}
    for _, role, candidate in pairs:
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
        found.leave(role for role in present if role != best)
    if axes and found.shared.get("position") is place:
        found.parts["position"] = axes
    _take_wheels(found)
    if not {"slope", "load"} & found.roles() and (angle := angle_of(candidates)):
        # the load follows from the mass, on the slope that they show
        found.shared["slope"], found.parts["slope"] = angle[0], angle[1:]
    speeds = {"wheel_speed", "rim_speed", "ground_speed"} & found.shared.keys()
    set_speed = any(found.shared[role].about.constant for role in speeds)
    if set_speed and "slip" in found.shared and not found.shared["slip"].about.constant:
        # simulated rigs write the speeds that they set, in which no sensor can be seen to live
        found.leave([*speeds, "position", "wheel_angle"])
    turns = {"wheel_speed", "wheel_angle", "rim_speed"} & found.roles()
    if turns and {"ground_speed", "position"} & found.roles():
        found.leave(["slip"])  # measured slip is better known than one that somebody has computed
    return found


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
            members = sorted(alike.values(), key=lambda c: c.address)
            if len(members) <= _TOGETHER[role] and len({c.kind for c in members}) == 1:
                found.shared[role], found.parts[role] = members[0], members[1:]
                found.move(role, members)
        return
    names = {name for alike in groups.values() for name in alike}
    complete = [n for n in sorted(names) if all(n in alike for alike in groups.values())]
    if len(complete) < 2:
        return
    for role, alike in groups.items():
        found.shared.pop(role)
        found.move(role, alike.values())
        for name in complete:
            found.wheels.setdefault(name, {})[role] = alike[name]


def _frame(candidate: Candidate) -> tuple[str, ...]:
    """The words of a name without those of the wheel."""
    return tuple(word for word in words_of(candidate.address) if word not in WHEEL_WORDS)


def wheel_name(address: str) -> str:
    """Name of the wheel that a column belongs to: `front_left`, `wheel_3`; "" for none."""
    plain = [side for word in wheel_word(address) for side in _SIDES.get(word, (word,))]
    name = "_".join(dict.fromkeys(plain))
    return f"wheel_{name}" if name[:1].isdigit() else name


def axle_of(wheel: str) -> str:
    """The axle that the name of a wheel says; "" where it says none."""
    axles = {"front": "front", "rear": "rear", "back": "rear"}
    axles |= dict.fromkeys(("middle", "mid", "centre", "center"), "middle")
    return next((axle for word, axle in axles.items() if word in wheel.split("_")), "")
