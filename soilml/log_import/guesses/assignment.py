"""Which column is taken for which role, for one wheel or for several."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.guesses.forces import OF_A_ROVER, is_vertical
from soilml.log_import.guesses.role_words import USUAL, WHEEL_WORDS, says, wheel_word, words_of

#: Roles of which one suffices, the better one first where both fit as well.
_RIVALS = (
    ("rim_speed", "wheel_speed", "wheel_angle"),
    ("ground_speed", "position"),
    ("torque", "motor_current"),
)
_TURNING, _TRAVEL = {*_RIVALS[0]}, {*_RIVALS[1]}
_MEASURED = 3.0  # What a measured torque is worth over a current, whose constants no log shows
_LEAST = 2.0  # Lowest score of a guess
_AXLES = {"f": "front", "r": "rear", "b": "rear", "m": "middle", "c": "middle"}
#: Two letters in either order: fl, lf -> front, left.
_SIDES = {
    pair: (axle, side)
    for letter, axle in _AXLES.items()
    for short, side in (("l", "left"), ("r", "right"))
    for pair in (letter + short, short + letter)
}
#: Axle by the word in the name of a wheel.
_AXLE_OF = {"back": "rear", "mid": "middle", "centre": "middle", "center": "middle"}
_AXLE_OF |= {name: name for name in _AXLES.values()}


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

    def use(self, role: str, members: Iterable[Candidate]) -> None:
        """Take columns that are used out of the runners-up."""
        used = [*members]
        self.others[role] = [c for c in self.others.get(role, []) if c not in used]


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
    axes = _axes_of(place, candidates) if place is not None else []
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
        best = max(present, key=lambda r: found.shared[r].score(r) - 0.1 * rivals.index(r) +
                   (_MEASURED if r == "torque" else 0.0), default="")  # fmt: skip
        found.leave(role for role in present if role != best)
    if axes and found.shared.get("position") is place:
        found.parts["position"] = axes
    _take_wheels(found)
    speeds = {"wheel_speed", "rim_speed", "ground_speed"} & found.shared.keys()
    set_speed = any(found.shared[role].constant for role in speeds)
    if set_speed and "slip" in found.shared and not found.shared["slip"].constant:
        # simulated rigs write the speeds that they set, in which no sensor can be seen to live
        found.leave([*speeds, "position", "wheel_angle"])
    if _TURNING & found.roles() and _TRAVEL & found.roles():
        found.leave(["slip"])  # measured slip is better known than one that somebody has computed
    return found


def _axes_of(column: Candidate, candidates: Sequence[Candidate]) -> list[Candidate]:
    """The columns of y and, where there is one, z, beside that of x; empty for none.

    A rover drives in any direction, so that x alone is a share of its travel. Without y, z is no
    part of the place: it may be the sinkage of a gantry. Where a rover drives straight, y may be
    constant.
    """
    known = {c.address: c for c in candidates if not is_vertical(c)}
    for match in reversed(list(re.finditer("[xX]", column.address))):
        before, after = column.address[: match.start()], column.address[match.end() :]
        y, z = (known.get(before + axis + after) for axis in ("yz" if match[0] == "x" else "YZ"))
        if y is None or (y.constant and not says(y.address, OF_A_ROVER)):
            continue
        if others := [own for own in (y, z) if own is not None and not own.constant]:
            return others
    return []


def _take_wheels(found: Assignment) -> None:
    """Move the roles of which several wheels have columns of one pattern to these wheels."""
    groups: dict[str, dict[str, Candidate]] = {}
    for role, best in found.shared.items():
        if not (USUAL[role].per_wheel and wheel_word(best.address)):
            continue
        alike = {_wheel_name(best.address): best}
        for other in found.others.get(role, []):
            name = _wheel_name(other.address)
            same = other.score(role) >= best.score(role) - 1.5 and _frame(other) == _frame(best)
            if name and same and name not in alike:
                alike[name] = other
        if len(alike) >= 2:
            groups[role] = alike
    if groups and all(USUAL[role].together > 1 for role in groups):
        # nothing turns or drives for itself: cells and sensors of one wheel
        for role, alike in groups.items():
            members = sorted(alike.values(), key=lambda c: c.address)
            if len(members) <= USUAL[role].together and len({c.kind for c in members}) == 1:
                found.shared[role], found.parts[role] = members[0], members[1:]
                found.use(role, members)
        return
    names = {name for alike in groups.values() for name in alike}
    complete = [n for n in sorted(names) if all(n in alike for alike in groups.values())]
    if len(complete) < 2:
        return
    for role, alike in groups.items():
        found.shared.pop(role)
        found.use(role, alike.values())
        for name in complete:
            found.wheels.setdefault(name, {})[role] = alike[name]


def _frame(candidate: Candidate) -> tuple[str, ...]:
    """The words of a name without those of the wheel."""
    return tuple(word for word in words_of(candidate.address) if word not in WHEEL_WORDS)


def _wheel_name(address: str) -> str:
    """Name of the wheel that a column belongs to: `front_left`, `wheel_3`; "" for none."""
    plain = [side for word in wheel_word(address) for side in _SIDES.get(word, (word,))]
    name = "_".join(dict.fromkeys(plain))
    return f"wheel_{name}" if name[:1].isdigit() else name


def axle_of(wheel: str) -> str:
    """The axle that the name of a wheel says; "" where it says none."""
    return next((_AXLE_OF[word] for word in wheel.split("_") if word in _AXLE_OF), "")
