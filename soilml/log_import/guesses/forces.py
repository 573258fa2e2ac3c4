"""Which of several alike forces and moments are load, pull and torque, by how they behave.

Axes of a force sensor lie as somebody has mounted it, so that x, y and z say little. On a wheel
that drives, the largest steady force is the load. The torque and the pull vary together, beside
what either has of the load. A place of the load's axis is the height of the wheel, if it changes
little.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.log_import.channels.resampling import on_grid
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.guesses.role_words import says, words_of
from soilml.log_import.mapping.written_map import Marked
from soilml.log_import.units import factor

_FORCES = {*words_of("f fx fy fz force forces kraft fuerza forza 力")}
_MOMENTS = {*words_of("m mx my mz t tx ty tz moment torque drehmoment tau momento couple coppia")}
#: Words of cells that carry a wheel together, whose forces are added; before the number of a wheel.
_NOT_ALIKE = {*words_of("lc cell zelle celda cella corner wheel rad motor joint axle leg")}
_BLOCKS, _FEWEST = 240, 12  # Means of which the behaviour is judged: most and fewest
_DRIVES = 0.3  # Share of the usual speed from which a wheel drives
#: How much larger the load is than another force; its scatter over its size; correlation of pull
#: and torque; share of the load that a pull varies by.
_CLEARLY, _STEADY, _TOGETHER_FROM, _VARIES = 1.3, 0.6, 0.6, 0.02
_BY_BEHAVIOUR = 9.0  # Score of a column whose behaviour, or whole name, shows the role
_ROLES = ("load", "drawbar_pull", "torque")
#: Axis of a name, and number of a channel.
_AXIS, _NUMBER = re.compile(r"[xyz](?![a-z])", re.IGNORECASE), re.compile(r"\d+")
#: Words of a place in the world, whose vertical is the terrain's.
OF_A_ROVER = {"odom", "odometry", "vo", "pose", "gps", "marker", "tracking"}
_OF_TRAVEL = 0.3  # Largest range of a sinkage, as a share of the travel
_NAMED, _BY_AXIS = 4.5, 9.0  # Score of a name that says sinkage, and of a place by its axis


def by_behaviour(
    candidates: Sequence[Candidate], run: Run
) -> tuple[list[Candidate], dict[str, str]]:
    """Give the load, the pull and the torque of alike columns the roles that they behave as.

    A place along the axis of the load is the sinkage. Returns the candidates with the scores that
    their behaviour gives them, and a reason by role.
    """
    family = _largest_family(c for c in candidates if _is_alike(c, False))
    forces = [*family.values()]
    moments = [*_largest_family(c for c in candidates if _is_alike(c, True)).values()]
    single = [c for c in candidates if _is_alike(c, True)] if forces and not moments else []
    moments = moments or single[: len(single) == 1]  # a single moment, of whatever axis
    group = [*forces, *moments]
    means = _Means(run, candidates, group[0].address) if group else None
    if means is None or means.count < _FEWEST:
        return list(candidates), {}
    given: dict[str, str] = {}
    reasons: dict[str, str] = {}
    named = {
        role: max(own, key=lambda c: c.score(role)).address
        for role in _ROLES
        if (own := [c for c in candidates if c not in group and c.score(role) >= _BY_BEHAVIOUR])
    }
    if "load" not in named and (load := _load(forces, means, reasons)):
        given["load"] = load
    steady = given.get("load") or named.get("load", "")
    pulls = [c.address for c in forces if c.address != steady]
    turning = [named["torque"]] if "torque" in named else [c.address for c in moments]
    pulls = [named["drawbar_pull"]] if "drawbar_pull" in named else pulls
    *pair, together = _pair(pulls, turning, means, steady)
    for role, address, others in zip(_ROLES[1:], pair, (forces, moments), strict=True):
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
        scores = {r: s for r, s in c.scores.items() if c.address not in decided or r not in _ROLES}
        scores |= {role: _BY_BEHAVIOUR for role, address in given.items() if address == c.address}
        found.append(replace(c, scores=scores))
    vertical = next((a for a, c in family.items() if c.address == given.get("load")), "")
    if vertical.isalpha() and not isinstance(reasons["load"], Marked):
        found, sinkage = _with_sinkage_along(found, vertical)
        if sinkage:
            reasons["sinkage"] = Marked(
                f"CHANGE: a place along {vertical}, the axis of the load: is it the wheel's height?"
            )
    return found, reasons


def _families(candidates: Iterable[Candidate], numbers: bool) -> list[dict[str, Candidate]]:
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


def _largest_family(candidates: Iterable[Candidate]) -> dict[str, Candidate]:
    return next(iter(_families(candidates, numbers=True)), {})


def _is_alike(candidate: Candidate, moments: bool) -> bool:
    words = {*words_of(candidate.name)}
    if words & _NOT_ALIKE or candidate.constant:
        return False
    if candidate.kind is not None:
        return candidate.kind in (("N m",) if moments else ("N", "kg"))
    return bool(words & (_MOMENTS if moments else _FORCES))


def _with_sinkage_along(candidates: Sequence[Candidate], axis: str) -> tuple[list[Candidate], str]:
    """The candidates with the place along the vertical axis as the sinkage, and its address.

    They are as they were, and the address is "", where a name says which column is the sinkage, or
    no place along the axis changes as little as a sinkage does. Of the places across the vertical,
    the travel is that which goes farthest.
    """
    named = any(c.score("sinkage") >= _NAMED and axis not in words_of(c.name) for c in candidates)
    for family in _families(filter(_is_place, candidates), numbers=False) if not named else ():
        own = family.get(axis)
        others = [c for letter, c in family.items() if letter != axis]
        farthest = max(others, key=lambda c: c.span)
        if own is None or own.constant or own.span >= _OF_TRAVEL * farthest.span:
            continue
        new = {own.address: replace(own, scores={"sinkage": _BY_AXIS})}
        for c in others:
            scores = {r: s for r, s in c.scores.items() if r != "sinkage"}
            if c is farthest:
                scores["position"] = max(c.score("position"), _NAMED)
            new[c.address] = replace(c, scores=scores)
        return [new.get(c.address, c) for c in candidates], own.address
    return list(candidates), ""


def is_vertical(candidate: Candidate) -> bool:
    """Whether a column was taken for the height of the wheel, by the axis of the load."""
    return candidate.scores == {"sinkage": _BY_AXIS}


def _is_place(candidate: Candidate) -> bool:
    if says(candidate.address, OF_A_ROVER) or candidate.kind not in (None, "m"):
        return False
    named = any(candidate.score(role) > 0.0 for role in ("position", "sinkage"))
    plain = {*words_of(candidate.address)} <= {"x", "y", "z", "pos", "position"}
    return candidate.kind == "m" or named or plain


class _Means:
    """Block means of the columns of a run, and the blocks in which the wheel drives.

    The blocks are those of the recording of `first`, whose clock the others are brought to.
    """

    def __init__(self, run: Run, candidates: Sequence[Candidate], first: str) -> None:
        self._run, (times, _) = run, run.find(first)
        self.count = min(_BLOCKS, times.size)
        self._grid = np.linspace(times[0], times[-1], self.count)
        self._columns = {c.address: c for c in candidates}
        self.driving = self._motion(candidates)

    def of(self, address: str) -> Floats:
        """Means (blocks,) of a column, forces in N and moments in N m where they state a unit."""
        column = self._columns[address]
        size = 9.80665 if column.kind == "kg" else 1.0
        if column.kind in ("N", "N m", "kg"):
            size *= factor(column.unit, column.kind)
        means = size * on_grid(self._grid, *self._run.find(address))
        known = np.isfinite(means)
        return np.where(known, means, np.median(means[known]) if known.any() else 0.0)

    def _motion(self, candidates: Sequence[Candidate]) -> NDArray[np.bool_]:
        """The blocks in which the best column of a speed, or of a place, moves; else all."""
        roles = ("wheel_speed", "rim_speed", "wheel_angle", "ground_speed", "position")
        best = max(((c.score(role), role, c.address) for role in roles for c in candidates),
                   key=lambda s: s[0], default=(0.0, "", ""))  # fmt: skip
        if best[0] > 2.0:
            speed = self.of(best[2])
            if best[1] in ("wheel_angle", "position") and speed.size > 2:
                speed = np.gradient(speed)
            driving: NDArray[np.bool_] = np.abs(speed) > _DRIVES * np.percentile(np.abs(speed), 90)
            if driving.sum() > 2:
                return driving
        return np.ones(self.count, dtype=bool)


def _load(forces: Sequence[Candidate], means: _Means, reasons: dict[str, str]) -> str:
    """The largest force that is steady while the wheel drives; "" for none."""
    driven = {c.address: means.of(c.address)[means.driving] for c in forces}
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
    pulls: Sequence[str], turning: Sequence[str], means: _Means, load: str
) -> tuple[str, str, float]:
    """Pull and torque: the force and the moment that vary most together, and their correlation.

    What varies with the load is taken off first: lateral forces and the moments that they make.
    """
    weight = means.of(load) if load else np.zeros(means.count)
    size = abs(float(np.median(weight[means.driving])))
    left = {address: _beside(means.of(address), weight) for address in (*pulls, *turning)}
    spread = {address: float(np.std(own)) for address, own in left.items()}
    lively = [a for a in pulls if spread[a] > _VARIES * size]
    best, most, correlation = ("", ""), 0.0, 0.0
    for f in lively:
        for m in (t for t in turning if spread[t] > 0.0):
            common = abs(float(np.corrcoef(left[f], left[m])[0, 1]))
            if common * spread[f] * spread[m] > most:
                best, most, correlation = (f, m), common * spread[f] * spread[m], common
    if correlation >= _TOGETHER_FROM:
        return (*best, correlation)
    return (
        max(lively, key=lambda a: spread[a], default=""),
        max(turning, key=lambda a: spread[a], default=""),
        0.0,
    )


def _beside(own: Floats, weight: Floats) -> Floats:
    """What of a column (n,) does not follow from the load (n,)."""
    rest = np.asarray(own - own.mean())
    if float(np.std(weight)) <= 0.05 * abs(float(weight.mean())):
        return rest  # nothing of note: the load did not change
    share = weight - weight.mean()
    return np.asarray(rest - share * float(share @ rest) / float(share @ share))
