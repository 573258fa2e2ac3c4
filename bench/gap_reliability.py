"""Reliability of stated probabilities: how often what was said with probability p is true."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from gap_records import Judged, interval

from soilml.inference.constants import EXPECTED_CAUSES

#: Statements in a bin.
BIN = 50
#: Edges of the wide bins; neighbours are joined until each has `BIN` statements.
WIDE_EDGES = (0.0, 0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.98, 1.0)
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

    @property
    def deviation(self) -> float:
        """Distance between what was stated and what happened."""
        return abs(self.stated - self.frequency)


def statements(sets: Sequence[Judged]) -> tuple[np.ndarray, np.ndarray]:
    """(n,) stated probabilities, ascending, and (n,) whether the effect was hidden in that set."""
    stated, true = _pairs(sets)
    order = np.argsort(stated, kind="stable")
    return stated[order], true[order]


def _pairs(sets: Sequence[Judged]) -> tuple[np.ndarray, np.ndarray]:
    """The same in the order of the sets."""
    pairs = [
        (p, name in s["truth"] or (s["tier"] in ("T", "C") and name in s.get("relatives", ())))
        for s in sets
        for name, p in s.get("probabilities", {}).items()
    ]
    stated = np.asarray([p for p, _ in pairs], dtype=np.float64)
    return stated, np.asarray([true for _, true in pairs], dtype=bool)


def equal_bins(stated: np.ndarray, true: np.ndarray) -> list[Bin]:
    """Bins of `BIN` neighbouring statements, the last one of more."""
    count = len(stated) // BIN
    if count == 0:
        return []
    cuts = [*range(BIN, count * BIN, BIN)]
    return [_bin(p, t) for p, t in zip(np.split(stated, cuts), np.split(true, cuts), strict=True)]


def wide_bins(stated: np.ndarray, true: np.ndarray) -> list[Bin]:
    """Bins between `WIDE_EDGES`, joined with the next until each has `BIN` statements."""
    cuts = _wide_cuts(stated)
    if cuts is None:
        return []
    return [_bin(p, t) for p, t in zip(np.split(stated, cuts), np.split(true, cuts), strict=True)]


def _wide_cuts(stated: np.ndarray) -> list[int] | None:
    """Where the wide bins of ascending probabilities begin, but the first; None for too few."""
    if len(stated) < BIN:
        return None
    cuts, last = [], 0
    for cut in np.searchsorted(stated, WIDE_EDGES[1:-1], side="right"):
        if cut - last >= BIN and len(stated) - cut >= BIN:
            cuts.append(int(cut))
            last = int(cut)
    return cuts


def largest(bins: Sequence[Bin]) -> float:
    """The largest deviation of any bin; NaN without bins."""
    return max((b.deviation for b in bins), default=float("nan"))


def chance(bins: Sequence[Bin]) -> tuple[float, float]:
    """Median and 95 % quantile of the largest deviation if all probabilities were exact."""
    if not bins:
        return float("nan"), float("nan")
    generator = np.random.default_rng(0)
    stated = np.asarray([b.stated for b in bins])
    count = np.asarray([b.count for b in bins])
    drawn = generator.binomial(count, stated, (SIMULATIONS, len(bins))) / count
    worst = np.abs(drawn - stated).max(axis=1)
    return float(np.median(worst)), float(np.quantile(worst, 0.95))


def chance_of_as_much(stated: np.ndarray, true: np.ndarray) -> float:
    r"""Share of analysts with exact probabilities whose wide bins deviate as much, in all.

    .. math:: \sum_b \frac{(O_b - \sum p)^2}{\sum p (1 - p)}

    with O_b effects that were hidden in bin b. The effects of one set exclude each other for the
    most part, so that independent ones deviate a little more. NaN without bins.

    References: Hosmer and Lemeshow, Communications in Statistics A9(10), 1980.
    """
    cuts = _wide_cuts(stated)
    if cuts is None:
        return float("nan")
    first = [0, *cuts]
    expected = np.add.reduceat(stated, first)
    variance = np.add.reduceat(stated * (1.0 - stated), first)

    def deviation(hidden: np.ndarray) -> float:
        found = np.add.reduceat(hidden.astype(np.float64), first)
        return float(np.sum((found - expected) ** 2 / np.maximum(variance, 1e-9)))

    generator, own = np.random.default_rng(0), deviation(true)
    drawn = [deviation(generator.random(len(stated)) < stated) for _ in range(SIMULATIONS)]
    return float(np.mean([value >= own for value in drawn]))


def calibration_error(
    sets: Sequence[Judged],
) -> tuple[float, tuple[float, float], tuple[float, float]]:
    """Expected calibration error of statements from `NOTABLE` on, in their wide bins.

    The mean of |stated - frequency| over these statements; its 95 % interval over sets that are
    drawn with replacement; and its median and 95 % quantile for exact probabilities.
    """
    pairs = [_pairs([s]) for s in sets]
    own = [(p[p >= NOTABLE], t[p >= NOTABLE]) for p, t in pairs if np.any(p >= NOTABLE)]
    stated, true = statements(sets)
    stated, true = stated[stated >= NOTABLE], true[stated >= NOTABLE]
    cuts = _wide_cuts(stated)
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


def at_expected_mix(sets: Sequence[Judged]) -> list[Bin]:
    """The wide bins, where as many sets lack a cause of the catalogue as the analyst expects.

    The prior expects `EXPECTED_CAUSES` causes, so that a share of exp(-1) of all sets has none. The
    benchmark has fewer of these; they are weighted. Empty without bins or without such sets.
    """
    stated, _ = statements(sets)
    cuts = _wide_cuts(stated)
    without = [not s["catalogued"] for s in sets]
    share = float(np.mean(without)) if sets else 0.0
    if cuts is None or not 0.0 < share < 1.0:
        return []
    expected = float(np.exp(-EXPECTED_CAUSES))
    weight = expected / (1.0 - expected) * (1.0 - share) / share
    parts = [(*_pairs([s]), weight if bare else 1.0) for s, bare in zip(sets, without, strict=True)]
    p = np.concatenate([own for own, _, _ in parts])
    true = np.concatenate([own for _, own, _ in parts])
    weights = np.concatenate([np.full(len(own), w) for own, _, w in parts])
    at = np.searchsorted(stated[cuts], p, side="right")
    total = np.bincount(at, weights)
    means = [np.bincount(at, weights * values) / total for values in (p, true)]
    count = np.bincount(at)
    return [Bin(float(m), float(f), int(n)) for m, f, n in zip(*means, count, strict=True)]


def save_picture(sets: Sequence[Judged], file: Path) -> None:
    """Frequency over stated probability, with 95 % intervals; nothing without probabilities."""
    stated, true = statements(sets)
    small, wide = equal_bins(stated, true), wide_bins(stated, true)
    if not wide:
        return
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5.0, 4.6), layout="constrained")
    axes.plot([0, 1], [0, 1], color="0.6", lw=1.0, zorder=0)
    axes.scatter(
        [b.stated for b in small], [b.frequency for b in small], s=10, color="0.7", label="50 each"
    )
    x, y = np.asarray([[b.stated, b.frequency] for b in wide]).T
    low, high = np.asarray([interval(round(b.frequency * b.count), b.count) for b in wide]).T
    span = [np.maximum(y - low, 0.0), np.maximum(high - y, 0.0)]
    axes.errorbar(x, y, span, fmt="o", ms=5, color="C0", label="wide bins, 95 % interval")
    axes.set(
        xlabel="stated probability of an effect",
        ylabel="share in which it was hidden",
        xlim=(-0.02, 1.02),
        ylim=(-0.02, 1.02),
    )
    axes.legend(frameon=False, loc="upper left")
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, format="png", dpi=110, metadata={"Software": "soilml"})
    plt.close(figure)


def _bin(stated: np.ndarray, true: np.ndarray) -> Bin:
    return Bin(float(stated.mean()), float(true.mean()), len(stated))
