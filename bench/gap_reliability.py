"""Reliability of stated probabilities: how often what was said with probability p is true."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Judged = dict[str, Any]

#: Statements in a bin, at least.
BIN = 50
#: Edges of the bins; neighbours are joined until each has `BIN` statements.
EDGES = (0.0, 0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.98, 1.0)
#: Simulations of an analyst whose probabilities are exact, and draws of the sets with replacement.
SIMULATIONS = 400
#: Stated probability from which a statement is one that a user acts on.
NOTABLE = 0.02


@dataclass(frozen=True)
class Bin:
    """Statements of similar probability: their mean, how often they were true, their number."""

    stated: float
    frequency: float
    count: int


def statements(sets: Sequence[Judged]) -> tuple[np.ndarray, np.ndarray]:
    """(n,) stated probabilities, ascending, and (n,) whether the effect was hidden in that set."""
    pairs = [
        (p, name in s["truth"] or (s["tier"] in ("T", "C") and name in s.get("relatives", ())))
        for s in sets
        for name, p in s.get("probabilities", {}).items()
    ]
    stated = np.asarray([p for p, _ in pairs], dtype=np.float64)
    order = np.argsort(stated, kind="stable")
    return stated[order], np.asarray([true for _, true in pairs], dtype=bool)[order]


def bins_of(stated: np.ndarray, true: np.ndarray) -> list[Bin]:
    """Bins between `EDGES`, joined with the next until each has `BIN` statements."""
    cuts = _cuts(stated)
    if cuts is None:
        return []
    parts = zip(np.split(stated, cuts), np.split(true, cuts), strict=True)
    return [Bin(float(p.mean()), float(t.mean()), len(p)) for p, t in parts]


def _cuts(stated: np.ndarray) -> list[int] | None:
    """Where the bins of ascending probabilities begin, but the first; None for too few."""
    if len(stated) < BIN:
        return None
    cuts, last = [], 0
    for cut in np.searchsorted(stated, EDGES[1:-1], side="right"):
        if cut - last >= BIN and len(stated) - cut >= BIN:
            cuts.append(int(cut))
            last = int(cut)
    return cuts


def calibration_error(
    sets: Sequence[Judged],
) -> tuple[float, tuple[float, float], tuple[float, float]]:
    """Expected calibration error of statements from `NOTABLE` on, in their bins.

    The mean of |stated - frequency| over these statements; its 95 % interval over sets that are
    drawn with replacement; and its median and 95 % quantile for exact probabilities.
    """
    pairs = [statements([s]) for s in sets]
    own = [(p[p >= NOTABLE], t[p >= NOTABLE]) for p, t in pairs if np.any(p >= NOTABLE)]
    stated, true = statements(sets)
    stated, true = stated[stated >= NOTABLE], true[stated >= NOTABLE]
    cuts = _cuts(stated)
    if cuts is None:
        return float("nan"), (float("nan"),) * 2, (float("nan"),) * 2
    edges = stated[cuts]

    def error(p: np.ndarray, t: np.ndarray) -> float:
        at = np.searchsorted(edges, p, side="right")
        off = np.bincount(at, p - t, minlength=len(edges) + 1)
        return float(np.abs(off).sum() / len(p))

    generator = np.random.default_rng(0)
    again = []
    for _ in range(SIMULATIONS):
        drawn = [own[i] for i in generator.integers(len(own), size=len(own))]
        again.append(error(*(np.concatenate(part) for part in zip(*drawn, strict=True))))
    exact = [error(stated, generator.random(len(stated)) < stated) for _ in range(SIMULATIONS)]
    low, high = np.quantile(again, (0.025, 0.975))
    usual, seldom = np.quantile(exact, (0.5, 0.95))
    return error(stated, true), (float(low), float(high)), (float(usual), float(seldom))
