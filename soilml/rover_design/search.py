"""Designs that are tried: points within the limits, then points about the best one; the front."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.optional_imports import need
from soilml.processes import process_map, usable_cores
from soilml.rover_design.performance import SWEPT, Outcomes, evaluate
from soilml.rover_design.study import DesignStudy
from soilml.rover_design.worlds import DrawnWorlds

DESIGNS = 250  # Designs of the first round, unless another number is asked for
#: Later rounds, each with a share of the designs of the first, within a share of the limits about
#: the best design so far, which shrinks from round to round.
ROUNDS, SHARE, REACH, SHRINK = 6, 0.15, 0.25, 0.5
#: Rows of wheel, slip and world that a process solves at a time, which bounds its memory. Worlds
#: differ by their effects, and rows with one effect are solved together: few cost as much as many.
BLOCK_ROWS = 300_000
#: Quantiles of every result over the worlds, and their endings in tables.
QUANTILES = {"_p05": 0.05, "": 0.5, "_p95": 0.95}
#: Results of a design that have quantiles, and the names of their columns.
RESULTS = {
    "margin": "margin_N",
    "slip": "slip",
    "energy": "energy_J_per_m",
    "torque": "torque_Nm",
    "sinkage": "sinkage_m",
}
#: Differences below this share of a front's extent do not count.
SAME = 1e-9


@dataclass(frozen=True)
class Designs:
    """Designs that were tried, with what they do.

    dimensions: Values (k,) by the names of the study's dimensions.
    results: `probability` of meeting the goal, `probability_climbed` of a margin of zero,
        `margin_at_risk_N` (exceeded with the probability 1 - risk), and medians with ends of 90 %
        bands of `RESULTS`, (k,) each by column name.
    """

    dimensions: Mapping[str, Floats]
    results: Mapping[str, Floats]

    @property
    def count(self) -> int:
        """Number of designs, k."""
        return len(self.results["probability"])

    @property
    def columns(self) -> dict[str, Floats]:
        """Dimensions and results by column name."""
        return {**self.dimensions, **self.results}

    def least_of(self, least: str) -> Floats:
        """What the goal asks to be least, (k,)."""
        if least in self.dimensions:
            return self.dimensions[least]
        return np.nan_to_num(self.results[RESULTS[least]], nan=np.inf)

    def joined(self, other: Designs) -> Designs:
        """These designs, then others."""
        both = (self.dimensions, other.dimensions), (self.results, other.results)
        return Designs(
            *({key: np.concatenate([own[key], its[key]]) for key in own} for own, its in both)
        )


def searched(
    study: DesignStudy,
    worlds: DrawnWorlds,
    count: int = DESIGNS,
    progress: Callable[[int, int], None] | None = None,
) -> Designs:
    """About `count` designs within the limits, then rounds of further ones about the best so far.

    The best one has the least of what the goal asks for among those that meet it; where none does,
    it is the likeliest. All are compared in the same worlds.

    progress: Function of the designs done, and of those in all.

    References: Sobol, USSR Comput. Math. Math. Phys. 7(4), 1967 (points within the limits).
    """
    need("scipy", "design")
    from scipy.stats import qmc

    sizes = [count, *[max(1, round(SHARE * count))] * ROUNDS]
    open_sizes = max(len(study.varied), 1)
    middle: Floats | float = 0.5
    reach, found, fractions = 0.5, None, np.empty((0, open_sizes))
    for number, size in enumerate(sizes):
        u = qmc.Sobol(open_sizes, rng=number).random_base2(int(np.ceil(np.log2(size))))[:size]
        near = np.clip(middle + 2.0 * reach * (u - 0.5), 0.0, 1.0)
        dimensions, new = _distinct(study, near, found)
        if not len(new):
            break
        done = sum(sizes[:number])
        told = None if progress is None else partial(_told, progress, done, sum(sizes))
        own = tried(study, dimensions, worlds, told)
        found = own if found is None else found.joined(own)
        fractions = np.concatenate([fractions, new])
        middle, reach = fractions[best_design(study, found)], REACH * SHRINK**number
    assert found is not None
    return found


def _told(progress: Callable[[int, int], None], before: int, total: int, done: int) -> None:
    progress(min(before + done, total), total)


def _distinct(
    study: DesignStudy, fractions: Floats, known: Designs | None
) -> tuple[dict[str, Floats], Floats]:
    """Dimensions of the designs at fractions (k, d) that are not known yet, and their fractions."""
    values = {name: own.at(np.zeros(len(fractions))) for name, own in study.dimensions.items()}
    values |= {n: study.dimensions[n].at(fractions[:, i]) for i, n in enumerate(study.varied)}
    rows = np.stack(list(values.values()), axis=1)
    earlier = np.empty((0, rows.shape[1]))
    if known is not None:
        earlier = np.stack([known.dimensions[name] for name in values], axis=1)
    whole = np.concatenate([earlier, rows]).round(12)
    first = np.sort(np.unique(whole, axis=0, return_index=True)[1])
    new = first[first >= len(earlier)] - len(earlier)
    return {name: column[new] for name, column in values.items()}, fractions[new]


def tried(
    study: DesignStudy,
    dimensions: Mapping[str, Floats],
    worlds: DrawnWorlds,
    progress: Callable[[int], None] | None = None,
) -> Designs:
    """Designs with these dimensions (k,), on the slips of a sweep, by several processes.

    progress: Given the number of designs done.
    """
    count = len(dimensions["radius"])
    axles = max(1, int(dimensions["wheels"].max()) // 2)
    most = max(1, BLOCK_ROWS // (worlds.count * len(SWEPT) * axles))
    size = max(1, min(most, count // usable_cores()))
    blocks = [
        {name: column[i : i + size] for name, column in dimensions.items()}
        for i in range(0, count, size)
    ]
    parts: list[dict[str, Floats]] = []
    with process_map(partial(_results, study, worlds), blocks) as results:
        for part in results:
            parts.append(part)
            if progress is not None:
                progress(min(size * len(parts), count))
    joined = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    return Designs(dict(dimensions), joined)


def _results(
    study: DesignStudy, worlds: DrawnWorlds, designs: Mapping[str, Floats]
) -> dict[str, Floats]:
    return summary(study, evaluate(study, designs, worlds, shares=SWEPT))


def summary(study: DesignStudy, found: Outcomes) -> dict[str, Floats]:
    """Results (k,) by column name of outcomes (k, n)."""
    results: dict[str, Floats] = {
        "probability": found.met.mean(axis=1),
        "probability_climbed": (found.margin >= 0.0).mean(axis=1),
        "margin_at_risk_N": quantile_of_worlds(found.margin, study.goal.risk),
    }
    for name, key in RESULTS.items():
        for ending, fraction in QUANTILES.items():
            results[key + ending] = quantile_of_worlds(getattr(found, name), fraction)
    return results


def quantile_of_worlds(values: Floats, fraction: float) -> Floats:
    """Quantile (k,) of the values (k, n) that are numbers; NaN where none is.

    One of the values, since some are infinite and between these nothing is interpolated.
    """
    known = np.isfinite(values) | np.isinf(values)
    ordered = np.sort(np.where(known, values, np.inf), axis=1)
    number = known.sum(axis=1)
    at = np.clip(np.ceil(fraction * number).astype(int) - 1, 0, None)
    picked = np.take_along_axis(ordered, at[:, None], axis=1)[:, 0]
    return np.where(number > 0, picked, np.nan)


def meets(study: DesignStudy, designs: Designs) -> NDArray[np.bool_]:
    """Designs (k,) that meet the goal with the probability that its risk leaves."""
    return np.asarray(designs.results["probability"] >= 1.0 - study.goal.risk - SAME)


def best_design(study: DesignStudy, designs: Designs) -> int:
    """The design that meets the goal with the least of what it asks for; else the likeliest one.

    Among equals, the one with the larger margin at the goal's risk.
    """
    found = meets(study, designs)
    margin, probability = (designs.results[key] for key in ("margin_at_risk_N", "probability"))
    if found.any():
        return int(np.lexsort((-margin, designs.least_of(study.goal.least), ~found))[0])
    return int(np.lexsort((-margin, -probability))[0])


def pareto_front(study: DesignStudy, designs: Designs) -> NDArray[np.int64]:
    """Designs that no other one beats in both margin at risk and what is to be least, ordered."""
    gain = designs.results["margin_at_risk_N"]
    least = designs.least_of(study.goal.least)
    usable = np.flatnonzero(np.isfinite(gain) & np.isfinite(least))
    order = usable[np.lexsort((-gain[usable], least[usable]))]
    front: list[int] = []
    highest = -np.inf
    extent = float(np.ptp(gain[usable])) if usable.size else 0.0
    for i in order:
        if gain[i] > highest + SAME * extent:
            front.append(int(i))
            highest = float(gain[i])
    return np.asarray(front, dtype=np.int64)
