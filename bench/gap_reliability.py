"""Reliability of stated probabilities: how often what was said with probability p is true."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Judged = dict[str, Any]

#: Statements in a bin, at least; edges of the bins, which are joined until each has so many.
BIN = 50
EDGES = (0.0, 0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.98, 1.0)
#: Simulations of an analyst whose probabilities are exact.
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
    """Bins of ascending probabilities between `EDGES`, each of `BIN` statements or more."""
    if len(stated) < BIN:
        return []
    cuts, last = [], 0
    for cut in np.searchsorted(stated, EDGES[1:-1], side="right").tolist():
        if cut - last >= BIN and len(stated) - cut >= BIN:
            cuts.append(cut)
            last = cut
    parts = zip(np.split(stated, cuts), np.split(true, cuts), strict=True)
    return [Bin(float(p.mean()), float(t.mean()), len(p)) for p, t in parts]


def calibration_error(sets: Sequence[Judged]) -> tuple[float, float]:
    """Expected calibration error of statements from `NOTABLE` on, and its 95 % quantile by chance.

    The mean of |stated - frequency| over their bins; chance is that of exact probabilities. NaN for
    too few statements.
    """
    stated, true = statements(sets)
    stated, true = stated[stated >= NOTABLE], true[stated >= NOTABLE]

    def error(happened: np.ndarray) -> float:
        bins = bins_of(stated, happened)
        return sum(b.count * abs(b.stated - b.frequency) for b in bins) / max(len(stated), 1)

    if len(stated) < BIN:
        return float("nan"), float("nan")
    generator = np.random.default_rng(0)
    exact = [error(generator.random(len(stated)) < stated) for _ in range(SIMULATIONS)]
    return error(true), float(np.quantile(exact, 0.95))
