"""Set posteriors beside the exact posterior of the same sets: `python bench/sets.py`.

With --limit the exact posteriors are computed anew, six minutes on two cores, and kept. Noise is a
share of the true value, and sets tell its standard deviation there; a file's own noise is a share
of the reading, which is measured beside it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from place import ROOT

from soilml.quantities import SHEAR
from training.benchmark.bayes_limit_file import load, save
from training.benchmark.sets.agreement import Agreement, agreement, combined, uniform
from training.benchmark.sets.reference_sets import (
    ANY,
    ONE,
    computed,
    kept,
    on_one_wheel,
    references,
    with_noise_of_reading,
)

#: Goals: RMSE over the exact posterior's, log density lacking (nat), what 90 % intervals hold, and
#: the least chance of ranks as uneven.
RATIO, GAP, HELD, CHANCE = 1.05, 0.1, (0.88, 0.92), 0.01
#: A figure that misses its goal by less than so many of its standard errors does not settle it.
DOUBT = 2.0
SYMBOLS = ("c", "phi", "K")
HINT = "compute it anew: make limit"
#: Ends of bins for the ranks of what the file stands for, of its interval, of exact quantiles.
RANKS, INTERVAL, QUARTERS = np.linspace(0.1, 0.9, 9), (0.05, 0.95), (0.05, 0.25, 0.75, 0.95)


@cache
def measured(folder: Path) -> dict[str, list[Agreement]]:
    """Every file on its sets, by design."""
    wanted = references()
    limit = load(kept(), wanted, HINT)
    first = sum(r.label == ONE for r in wanted)
    one, every = slice(0, first), slice(first, len(wanted))
    assert all(r.label == ANY for r in wanted[every])
    any_wheel = folder / "any_wheel.onnx"
    return {
        "wheel, reference wheel": agreement(folder / "wheel.onnx", wanted[one], limit.rows(one)),
        "any_wheel, reference wheel": agreement(
            any_wheel, on_one_wheel(wanted[one]), limit.rows(one)
        ),
        "any_wheel, any wheel": agreement(any_wheel, wanted[every], limit.rows(every)),
        "any_wheel, any wheel, noise told by reading": agreement(
            any_wheel, with_noise_of_reading(wanted[every]), limit.rows(every)
        ),
    }


def errors(folder: Path) -> str:
    """RMSE over that of the exact posterior on the same sets, by size."""
    head = " | ".join(f"{s} | +-" for s in SYMBOLS)
    lines = [
        f"Goal: at most {RATIO:g} at every size. Of the sets that the file answers.",
        "",
        f"| file, sets | rows | sets | refused | {head} | goal |",
        "|---|---:|---:|---:|" + "---:|" * 6 + "---|",
    ]
    for name, parts in measured(folder).items():
        for part in parts:
            ratio, error = part.ratio
            cells = " | ".join(f"{r:.3f} | {e:.3f}" for r, e in zip(ratio, error, strict=True))
            met = _met(bool(np.all(ratio <= RATIO)), bool(np.all(ratio - DOUBT * error <= RATIO)))
            refused = 1.0 - part.own.given.mean()
            lines.append(
                f"| {name} | {_rows(part)} | {len(part.truth)} | {refused:.1%} | {cells} | {met} |"
            )
    return "\n".join(lines)


def densities(folder: Path) -> str:
    """Log density at the truth that a file lacks, of all unknowns together."""
    lines = [
        f"Goal: at most {GAP:g} nat. Of all unknowns together, bearing too where it is not known.",
        "",
        "| file, sets | of which | sets | gap, nat | +- | exact, nat | goal |",
        "|---|---|---:|---:|---:|---:|---|",
    ]
    for name, parts in measured(folder).items():
        for part, label in _split(parts):
            gap, error = part.gap
            met = _met(gap <= GAP, gap - DOUBT * error <= GAP)
            lines.append(
                f"| {name} | {label} | {len(part.truth)} | {gap:.3f} | {error:.3f} "
                f"| {part.dense.mean():.2f} | {met} |"
            )
    return "\n".join(lines)


def coverage(folder: Path) -> str:
    """What intervals and ellipsoids hold, beside what those of the exact posterior hold."""
    lines = [
        f"Goal: 90 % intervals hold {HELD[0]:.0%} to {HELD[1]:.0%}. Each cell is the file's "
        "figure, and the exact posterior's on the same sets. Among soils of one third of the prior "
        "even the exact posterior does not hold 90 %: it leans to the middle, and only over all of "
        "the prior does it hold what it says. Nor does the ellipsoid, for a posterior is no "
        "Gaussian. The file gives 90 % intervals only: 50 % is of the posterior it stands for.",
        "",
        f"| file, sets | of which | sets | {' | '.join(SYMBOLS)} | joint | goal |",
        "|---|---|---:|" + "---:|" * 4 + "---|",
    ]
    for name, parts in measured(folder).items():
        whole = combined(parts)
        thirds = _thirds(whole)
        for part, label in _split(parts):
            lines.append(_covered(name, label, part, *part.cover90(), part.joint90, goal=True))
        lines.append(_covered(name, "all, 50 %", whole, *whole.cover50, None, goal=False))
        for label, index in thirds.items():
            lines.append(_covered(name, label, whole, *whole.cover90(index), None, goal=False))
    return "\n".join(lines)


def calibration(folder: Path) -> str:
    """Whether the truth's rank in the posterior is uniform: simulation-based calibration."""
    lines = [
        f"Goal: a chance of at least {CHANCE:g} that right posteriors would fall into bins as "
        f"unevenly (chi-square). `ranks`: {len(RANKS) + 1} bins of the truth's rank in the "
        "posterior that the file stands for; `interval`: below, inside and above the file's own "
        "interval; `exact`: the exact posterior, in the bins of its kept quantiles. Reference: "
        "Talts et al., arXiv:1804.06788, 2018.",
        "",
        "| file, sets | sets | which | " + " | ".join(SYMBOLS) + " | goal |",
        "|---|---:|---|" + "---:|" * len(SYMBOLS) + "---|",
    ]
    for name, parts in measured(folder).items():
        whole = combined(parts)
        there = whole.own.given
        answered = whole.where(there)
        truth = answered.truth
        edges = np.stack([answered.own.low, answered.own.high])
        exact = np.stack(
            [answered.exact.low, *answered.least_inner.swapaxes(0, 1), answered.exact.high]
        )
        found = {
            "ranks": uniform(answered.below, RANKS),
            "interval": uniform(_binned(truth, edges, INTERVAL), INTERVAL),
            "exact": uniform(_binned(truth, exact, QUARTERS), QUARTERS),
        }
        for which, chance in found.items():
            cells = " | ".join(f"{p:.2g}" for p in chance)
            met = "" if which == "exact" else _met(bool(np.all(chance >= CHANCE)), False)
            lines.append(f"| {name} | {len(truth)} | {which} | {cells} | {met} |")
    return "\n".join(lines)


def _binned(truth: np.ndarray, edges: np.ndarray, ends: Sequence[float]) -> np.ndarray:
    """A share inside the bin of each truth (n, q) among ascending edges (k, n, q)."""
    middles = 0.5 * (np.asarray([0.0, *ends]) + np.asarray([*ends, 1.0]))
    return middles[(truth > edges).sum(axis=0)]


def _split(parts: Sequence[Agreement]) -> list[tuple[Agreement, str]]:
    """All sets, those of each size, of each kind, and of each third of the noise."""
    whole = combined(parts)
    found = [(whole, "all"), *((part, f"{_rows(part)} rows") for part in parts)]
    found += [(whole.where(m), k) for k, m in whole.kinds.items() if 30 <= m.sum() < len(m)]
    low, high = np.quantile(whole.noise, [1.0 / 3.0, 2.0 / 3.0])
    if high > 1.2 * low:
        found.append((whole.where(whole.noise < low), f"torque noise below {low:.1%}"))
        found.append((whole.where(whole.noise > high), f"torque noise above {high:.1%}"))
    return found


def _thirds(whole: Agreement) -> dict[str, np.ndarray]:
    """Sets (n, q) whose truth is in each third of the prior."""
    share = (whole.truth - whole.lower) / (whole.upper - whole.lower)
    names = ("truth in the lower third", "in the middle third", "in the upper third")
    return {name: np.minimum((3.0 * share).astype(int), 2) == k for k, name in enumerate(names)}


def _covered(
    name: str,
    label: str,
    part: Agreement,
    own: np.ndarray,
    least: np.ndarray,
    joint: tuple[float, float] | None,
    goal: bool,
) -> str:
    cells = " | ".join(f"{a:.1%} / {b:.1%}" for a, b in zip(own, least, strict=True))
    both = "" if joint is None else f"{joint[0]:.1%} / {joint[1]:.1%}"
    doubt = DOUBT * np.sqrt(0.09 / len(part.truth))
    inside = np.all((own >= HELD[0]) & (own <= HELD[1]))
    near = np.all((own >= HELD[0] - doubt) & (own <= HELD[1] + doubt))
    met = _met(bool(inside), bool(near)) if goal else ""
    return f"| {name} | {label} | {len(part.truth)} | {cells} | {both} | {met} |"


def _met(met: bool, near: bool) -> str:
    return "met" if met else "missed, within its error" if near else "MISSED"


def _rows(part: Agreement) -> int:
    return int(part.design.split()[-2])


def limit() -> None:
    """Compute and keep the exact posteriors of all reference sets."""
    wanted = references()

    def told(text: str, done: int, total: int) -> None:
        if done % 200 == 0 or done == total:
            print(f"{text} {done} of {total}", file=sys.stderr, flush=True)

    found = list(computed(wanted, told))
    save(kept(), wanted, found)
    flagged = sum(f.flagged for f in found)
    print(f"{kept()}: {len(found)} sets of {', '.join(SHEAR)}, {flagged} flagged", file=sys.stderr)


def main(arguments: Sequence[str]) -> None:
    """Print all tables, of the files in a folder, else of the released ones."""
    if "--limit" in arguments:
        limit()
        return
    folder = Path(arguments[0] if arguments else ROOT / "exported")
    for table in (errors, densities, coverage, calibration):
        print(f"### {table.__doc__}\n\n{table(folder)}\n", flush=True)


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main(sys.argv[1:])
