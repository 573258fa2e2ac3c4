"""The search for missing effects: add, swap and drop until nothing is left to explain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.gap.search.candidate_fits import Bench, Candidate, coordinates
from soilml.gap.statistics.least_squares import GapFit
from soilml.gap.statistics.score_test import Scores, outside, scores
from soilml.gap.statistics.signatures import Signature, Untestable, signatures
from soilml.gap.statistics.smooth_basis import smooth_columns

Floats = NDArray[np.float64]

#: Family-wise level of the test for a gap.
LEVEL = 0.03
#: Level below which what a candidate leaves is no noise.
ADEQUATE = 0.001
#: Objective above the best one's at which a candidate is rejected.
REJECTED = 9.0
#: How much a further effect must lower the objective.
EARNS = 12.0
#: Candidates that are fitted in full: those whose predicted gain comes this close to the largest,
#: and so many more; and effects that are added at most.
CLOSE, FITTED = 15.0, 6
MOST = 3
#: The gain that free shapes are hoped for, in linearised gains: those fall short where sizes move.
HOPE = 3.0


@dataclass(frozen=True)
class Left:
    """What a fit leaves: scores of the catalogue and of smooth shapes, tested together."""

    signatures: tuple[Signature, ...]
    names: tuple[str, ...]
    scores: Scores
    #: p value of the largest score among all columns
    p: float


@dataclass(frozen=True)
class Found:
    """What the search ended with."""

    soil: GapFit
    first: Left
    #: candidates that the data do not reject against the best, the best first
    causes: tuple[Candidate, ...]
    #: everything that was fitted, for the table of candidates
    tried: tuple[Candidate, ...]
    #: what the best leaves, or the soil alone where nothing was found
    left: Left
    predicted_gain: dict[str, float]
    #: effects of which these runs can say nothing
    cannot: tuple[Untestable, ...] = ()

    @property
    def gap(self) -> bool:
        """Whether there is anything to explain."""
        return self.first.p < LEVEL

    @property
    def adequate(self) -> bool:
        """Whether the best candidate leaves no more than noise."""
        return self.left.p >= ADEQUATE


def left_by(bench: Bench, fit: GapFit, known: Sequence[Signature], seed: int) -> Left:
    """Test what a fit leaves, with everything that it could move projected off.

    Other laws of the effects that are there count as such: see `Bench.forms`.
    """
    whiten = bench.covariance.whiten
    smooth = smooth_columns(bench.cells)
    columns = whiten @ np.column_stack([*[s.column for s in known], smooth])
    signs = np.asarray([s.sign for s in known] + [0] * smooth.shape[1], dtype=np.float64)
    space = np.column_stack([fit.slope, *bench.forms(fit)])
    found = scores(fit.residual, columns, space, signs, bench.covariance.scatter.freedom, seed)
    return Left(tuple(known), tuple(s.name for s in known), found, found.worst)


def predicted_gains(bench: Bench, fit: GapFit, known: Sequence[Signature]) -> dict[str, float]:
    """By how much each effect, its form left open, should lower the objective: linearised."""
    whiten = bench.covariance.whiten
    slip, load = bench.cells.slip, np.log(bench.cells.load)
    forms = [np.ones_like(slip), slip - slip.mean(), load - load.mean()]
    gains = {}
    for s in known:
        shaped = bench.shapes([s.name])
        white = whiten @ np.stack([s.column * f for f in forms[: 1 + len(shaped)]], axis=1)
        beyond = outside(white, fit.slope)
        main = beyond[:, 0]
        power = float(main @ main)
        if power <= 0.0:
            gains[s.name] = 0.0
            continue
        size = float(main @ fit.residual) / power
        if s.sign and size * s.sign <= 0:
            size = 0.02 * s.sign
        std = bench.sizes([s.name])[0].std
        precision = np.asarray([std**-2, *[(axis.std * size) ** -2 for axis in shaped]])
        normal = beyond.T @ beyond + np.diag(precision)
        moment = beyond.T @ fit.residual
        gains[s.name] = float(moment @ np.linalg.solve(normal, moment))
    return gains


Starts = Mapping[tuple[str, ...], Mapping[str, float]]


def search(bench: Bench, soil: GapFit, seed: int, starts: Starts | None = None) -> Found:
    """Name what the soil alone does not explain.

    Candidates are fitted jointly with the soil, by their own law; where that could bring them into
    the running, with their form left open. As long as the best leaves more than noise, those in the
    running are tried with one effect more; a set that explains no more than a smaller one gives way
    to it. `starts` are coordinates by names, from an earlier search.
    """
    starts = starts or {}
    known, cannot = signatures(soil.fitted(), bench.cells, bench.effects)
    first = left_by(bench, soil, known, seed)
    gains = predicted_gains(bench, soil, known)
    nothing = Found(soil, first, (), (), first, gains, tuple(cannot))
    if first.p >= LEVEL:
        return nothing
    start = coordinates(soil)
    level = _loosened(bench, [bench.fit([n], starts.get((n,), start)) for n in _promising(gains)])
    tried = {c.names: c for c in level}
    level = [c for c in level if c.cost < soil.cost - EARNS / 2]
    if not level:
        return nothing
    best = min(level, key=lambda c: c.cost)
    left = _left(bench, best, seed)
    for _ in range(MOST - 1):
        if left.p >= ADEQUATE:
            break
        wider = _loosened(bench, _one_more(bench, level, tried, starts))
        tried |= {c.names: c for c in wider}
        if not wider:
            break
        better = min(wider, key=lambda c: c.cost)
        if better.cost > best.cost - EARNS:
            break
        level, best = wider, better
        left = _left(bench, best, seed)
    smaller = _dropped(bench, best, tried)
    if smaller is not None:
        best, left = smaller, _left(bench, smaller, seed)
    level = [c for c in tried.values() if len(c.names) == len(best.names)]
    final = [c for c in level if c.cost <= best.cost + REJECTED]
    final.sort(key=lambda c: c.cost)
    return replace(nothing, causes=tuple(final), tried=tuple(tried.values()), left=left)


def _loosened(bench: Bench, candidates: Sequence[Candidate]) -> list[Candidate]:
    """The candidates, with forms left open where that could bring them close to the best."""
    found: list[Candidate] = []
    lowest = np.inf
    for candidate in sorted(candidates, key=lambda c: c.cost):
        hope = candidate.cost - HOPE * bench.loose_gain(candidate)
        loose = bench.loosened(candidate) if hope < lowest + REJECTED else candidate
        lowest = min(lowest, loose.cost)
        found.append(loose)
    return found


def _left(bench: Bench, candidate: Candidate, seed: int) -> Left:
    fit = candidate.fit
    known, _ = signatures(fit.fitted(), bench.cells, bench.others(fit))
    return left_by(bench, fit, known, seed)


def _dropped(
    bench: Bench, best: Candidate, tried: dict[tuple[str, ...], Candidate]
) -> Candidate | None:
    """A set of fewer effects that explains hardly less than the best; None where each is needed."""
    smallest = None
    while len(best.names) > 1:
        fewer = [tuple(n for n in best.names if n != out) for out in best.names]
        for names in fewer:
            if names not in tried:
                fitted = bench.fit(names, coordinates(best.strict))
                tried[names] = _loosened(bench, [fitted])[0]
        least = min((tried[names] for names in fewer), key=lambda c: c.cost)
        if least.cost > best.cost + EARNS:
            break
        smallest = best = least
    return smallest


def _promising(gains: Mapping[str, float]) -> list[str]:
    """Effects worth a full fit, the most promising first."""
    ordered = [n for n in sorted(gains, key=lambda name: -gains[name]) if gains[n] > 4.0]
    if not ordered:
        return []
    close = [n for n in ordered if gains[n] > gains[ordered[0]] - CLOSE]
    return ordered[: max(FITTED, len(close))]


def _one_more(
    bench: Bench,
    level: Sequence[Candidate],
    tried: Mapping[tuple[str, ...], Candidate],
    starts: Starts,
) -> list[Candidate]:
    """Sets of one effect more: the best few of this level, each with what its residuals ask for."""
    found: dict[tuple[str, ...], Candidate] = {}
    for candidate in sorted(level, key=lambda c: c.cost)[:3]:
        fit = candidate.fit
        known, _ = signatures(fit.fitted(), bench.cells, bench.others(fit))
        gains = predicted_gains(bench, fit, known)
        for name in _promising(gains)[:3]:
            names = tuple(sorted((*candidate.names, name)))
            if names not in found and names not in tried:
                found[names] = bench.fit(names, starts.get(names, coordinates(candidate.strict)))
    return list(found.values())
