"""Which column is taken for which role, for one wheel or for several.

Axes of a force sensor lie as somebody has mounted it, so that x, y and z say little. On a wheel
that drives, the largest steady force is the load. The torque and the pull vary together.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.log_import.channels.resampling import on_grid
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.guesses.role_words import (
    USUAL,
    WHEEL_WORDS,
    group,
    says,
    wheel_word,
    words_of,
)
from soilml.log_import.mapping.written_map import Marked
from soilml.log_import.units import factor

#: Roles of which one suffices, the better one first where both fit as well.
_RIVALS = (
    ("rim_speed", "wheel_speed", "wheel_angle"),
    ("ground_speed", "position"),
    ("torque", "motor_current"),
)
_TURNING, _TRAVEL = {*_RIVALS[0]}, {*_RIVALS[1]}
_PLACES = ("wheel_angle", "position")  # Whose rate is a speed
_MEASURED = 3.0  # What a measured torque is worth over a current, whose constants no log shows
_LEAST = 2.0  # Lowest score of a guess
_OF_TRAVEL = 0.3  # Least range of a part of the way, over that of another one
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
_BLOCKS, _FEWEST = 240, 12  # Means of which the behaviour is judged: most and fewest
_DRIVES = 0.3  # Share of the usual speed from which a wheel drives
#: How much larger the load is than another force; its scatter over its size; correlation of pull
#: and torque; share of the load that a pull varies by.
_CLEARLY, _STEADY, _TOGETHER_FROM, _VARIES = 1.3, 0.6, 0.6, 0.02
_BY_BEHAVIOUR = 9.0  # Score of a column whose behaviour, or whole name, shows the role
_FORCE_ROLES = ("load", "drawbar_pull", "torque")
#: Axis of a name, and number of a channel.
_AXIS_OR_NUMBER = re.compile(r"[xyz](?![a-z])|\d+", re.IGNORECASE)


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
    rover, known = says(column.address, "rover"), {c.address: c for c in candidates}
    for match in reversed(list(re.finditer("[xX]", column.address))):
        before, after = column.address[: match.start()], column.address[match.end() :]
        y, z = (known.get(before + axis + after) for axis in ("yz" if match[0] == "x" else "YZ"))
        if y is None or (y.constant and not rover):
            continue
        # what changes little may be the height of the wheel on a rig
        others = [own for own in (y, z) if own is not None and not own.constant
                  and (rover or own.span > _OF_TRAVEL * column.span)]  # fmt: skip
        if others:
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
    return tuple(word for word in words_of(candidate.address) if word not in group(*WHEEL_WORDS))


def _wheel_name(address: str) -> str:
    """Name of the wheel that a column belongs to: `front_left`, `wheel_3`; "" for none."""
    plain = [side for word in wheel_word(address) for side in _SIDES.get(word, (word,))]
    name = "_".join(dict.fromkeys(plain))
    return f"wheel_{name}" if name[:1].isdigit() else name


def axle_of(wheel: str) -> str:
    """The axle that the name of a wheel says; "" where it says none."""
    return next((_AXLE_OF[word] for word in wheel.split("_") if word in _AXLE_OF), "")


def by_behaviour(
    candidates: Sequence[Candidate], run: Run
) -> tuple[list[Candidate], dict[str, str]]:
    """Give the load, the pull and the torque of alike columns the roles that they behave as.

    Returns the candidates with the scores that their behaviour gives them, and a reason by role.
    """
    forces = _largest_family(c for c in candidates if _is_alike(c, False))
    all_moments = [c for c in candidates if _is_alike(c, True)]
    moments = _largest_family(all_moments)
    if forces and len(all_moments) == 1:  # of whatever axis
        moments = all_moments
    group = [*forces, *moments]
    if not group or run.find(group[0].address)[0].size < _FEWEST:
        return list(candidates), {}
    means, driving = _block_means(run, candidates, group[0].address)
    given: dict[str, str] = {}
    reasons: dict[str, str] = {}
    named = {
        role: max(own, key=lambda c: c.score(role)).address
        for role in _FORCE_ROLES
        if (own := [c for c in candidates if c not in group and c.score(role) >= _BY_BEHAVIOUR])
    }
    if "load" not in named and (load := _load(forces, means, driving, reasons)):
        given["load"] = load
    steady = given.get("load") or named.get("load", "")
    pulls = [c.address for c in forces if c.address != steady]
    turning = [named["torque"]] if "torque" in named else [c.address for c in moments]
    pulls = [named["drawbar_pull"]] if "drawbar_pull" in named else pulls
    *pair, together = _pair(pulls, turning, means, driving, steady)
    for role, address, others in zip(_FORCE_ROLES[1:], pair, (forces, moments), strict=True):
        alone = role == "torque" and len(moments) == 1 and together < _TOGETHER_FROM
        if role not in named and not alone and any(c.address == address for c in others):
            given[role] = address
            reasons[role] = "pull and torque vary together"
            if together < _TOGETHER_FROM:
                reasons[role] = Marked(
                    "CHANGE: of its kind it varies most as the wheel drives, which says little"
                )
    # an axis that is none of the roles of its group is no other of them either
    decided = {c.address for c in forces if {"load", "drawbar_pull"} & given.keys()}
    decided |= {c.address for c in moments if "torque" in given}
    found = []
    for c in candidates:
        scores = {
            r: s for r, s in c.scores.items() if c.address not in decided or r not in _FORCE_ROLES
        }
        scores |= {role: _BY_BEHAVIOUR for role, address in given.items() if address == c.address}
        found.append(replace(c, scores=scores))
    return found, reasons


def _largest_family(candidates: Iterable[Candidate]) -> list[Candidate]:
    """Two or three columns whose names differ by an axis, or a number, alone; empty for none."""
    found: dict[tuple[str, str], dict[str, Candidate]] = {}
    for c in candidates:
        topic = c.address.removesuffix(c.name)
        for match in _AXIS_OR_NUMBER.finditer(c.name):
            frame = f"{c.name[: match.start()]}\0{c.name[match.end() :]}".lower()
            found.setdefault((topic, frame), {})[match[0].lower()] = c
    families = [[*own.values()] for own in found.values() if 2 <= len(own) <= 3]
    return max(families, key=len, default=[])


def _is_alike(candidate: Candidate, moments: bool) -> bool:
    if says(candidate.name, "cells") or candidate.constant:
        return False
    if candidate.kind is not None:
        return candidate.kind in (("N m",) if moments else ("N", "kg"))
    return says(candidate.name, "moments" if moments else "forces")


def _block_means(
    run: Run, candidates: Sequence[Candidate], first: str
) -> tuple[dict[str, Floats], NDArray[np.bool_]]:
    """Means (blocks,) by address, forces in N and moments in N m where they state a unit; and the
    blocks in which the best column of a speed, or of a place, moves, else all.

    The blocks are those of the recording of `first`, whose clock the others are brought to.
    """
    times, _ = run.find(first)
    grid, found = np.linspace(times[0], times[-1], min(_BLOCKS, times.size)), {}
    for c in candidates:
        size = 9.80665 if c.kind == "kg" else 1.0
        if c.kind in ("N", "N m", "kg"):
            size *= factor(c.unit, c.kind)
        own = size * on_grid(grid, *run.find(c.address))
        known = np.isfinite(own)
        found[c.address] = np.where(known, own, np.median(own[known]) if known.any() else 0.0)
    roles = ("wheel_speed", "rim_speed", "wheel_angle", "ground_speed", "position")
    score, role, address = max(((c.score(role), role, c.address) for role in roles
                                for c in candidates), key=lambda s: s[0])  # fmt: skip
    if score > 2.0:
        speed = np.abs(np.gradient(found[address]) if role in _PLACES else found[address])
        driving: NDArray[np.bool_] = speed > _DRIVES * np.percentile(speed, 90)
        if driving.sum() > 2:
            return found, driving
    return found, np.ones(grid.size, dtype=bool)


def _load(
    forces: Sequence[Candidate],
    means: Mapping[str, Floats],
    driving: NDArray[np.bool_],
    reasons: dict[str, str],
) -> str:
    """The largest force that is steady while the wheel drives; "" for none."""
    driven = {c.address: means[c.address][driving] for c in forces}
    levels = {address: abs(float(np.median(own))) for address, own in driven.items()}
    steady = {a: level for a, level in levels.items() if np.std(driven[a]) < _STEADY * level}
    best = max(steady, key=lambda a: (steady[a], a), default="")
    if best:
        most = max((level for a, level in levels.items() if a != best), default=0.0)
        reasons["load"] = f"the largest steady force of {len(forces)}"
        if levels[best] < _CLEARLY * most:
            share = f"{most / levels[best]:.0%}"
            reasons["load"] = Marked(
                f"CHANGE: one of {len(forces)} forces; another one is {share} of it"
            )
    return best


def _pair(
    pulls: Sequence[str],
    turning: Sequence[str],
    means: Mapping[str, Floats],
    driving: NDArray[np.bool_],
    load: str,
) -> tuple[str, str, float]:
    """Pull and torque: the force and the moment that vary most together, and their correlation."""
    size = abs(float(np.median(means[load][driving]))) if load else 0.0
    spread = {address: float(np.std(means[address])) for address in (*pulls, *turning)}
    lively = [a for a in pulls if spread[a] > _VARIES * size]
    best, most, correlation = ("", ""), 0.0, 0.0
    for f in lively:
        for m in (t for t in turning if spread[t] > 0.0):
            common = abs(float(np.corrcoef(means[f], means[m])[0, 1]))
            if common * spread[f] * spread[m] > most:
                best, most, correlation = (f, m), common * spread[f] * spread[m], common
    if correlation >= _TOGETHER_FROM:
        return (*best, correlation)
    return (
        max(lively, key=lambda a: spread[a], default=""),
        max(turning, key=lambda a: spread[a], default=""),
        0.0,
    )
