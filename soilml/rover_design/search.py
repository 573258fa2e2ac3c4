"""Designs that are tried: a sweep of the limits, an optimisation between them, and the front."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.optional_imports import need
from soilml.rover_design.performance import Outcomes, in_blocks
from soilml.rover_design.study import STEP, DesignStudy
from soilml.rover_design.worlds import DrawnWorlds

DESIGNS = 250  # Designs of a sweep, unless another number is asked for
#: Of the optimisation: designs of a generation for each dimension, and generations.
POPULATION, GENERATIONS = 8, 12
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
        `margin_at_risk_N` (exceeded with the probability 1 - risk), `lugs_needed`, and medians with
        ends of 90 % bands of `RESULTS`, (k,) each by column name.
    """

    dimensions: Mapping[str, Floats]
    results: Mapping[str, Floats]

    @property
    def count(self) -> int:
        """Number of designs, k."""
        return len(self.results["probability"])

    @property
    def lugs_suffice(self) -> NDArray[np.bool_]:
        """Designs (k,) with as many lugs as the model of the lugs takes for granted."""
        if "lug_count" not in self.dimensions:
            return np.ones(self.count, dtype=bool)
        needed = np.nan_to_num(self.results["lugs_needed"])
        return np.asarray(self.dimensions["lug_count"] >= needed)

    def least_of(self, least: str) -> Floats:
        """What the goal asks to be least, (k,)."""
        if least in self.dimensions:
            return self.dimensions[least]
        if least == "lug_count":
            return self.results["lugs_needed"]
        return np.nan_to_num(self.results[RESULTS[least]], nan=np.inf)

    def joined(self, other: Designs) -> Designs:
        """These designs and others, each design once."""
        both = [
            {key: np.concatenate([column, theirs[key]]) for key, column in mine.items()}
            for mine, theirs in (
                (self.dimensions, other.dimensions),
                (self.results, other.results),
            )
        ]
        rows = np.stack(list(both[0].values()), axis=1).round(12)
        first = np.sort(np.unique(rows, axis=0, return_index=True)[1])
        return Designs(*({key: column[first] for key, column in part.items()} for part in both))


def swept(
    study: DesignStudy,
    worlds: DrawnWorlds,
    count: int = DESIGNS,
    progress: Callable[[int], None] | None = None,
) -> Designs:
    """A grid of the limits where one or two dimensions vary, Sobol points where more do.

    References: Sobol, USSR Comput. Math. Math. Phys. 7(4), 1967.
    """
    varied = study.varied
    if len(varied) > 2:
        need("scipy", "design with more than two open dimensions")
        from scipy.stats import qmc

        unit = qmc.Sobol(len(varied), seed=0).random_base2(int(np.ceil(np.log2(count))))[:count]
        fractions = dict(zip(varied, unit.T, strict=True))
    else:
        fractions = grid_fractions(study, varied, count)
    return tried(study, at_fractions(study, fractions), worlds, progress)


def grid_fractions(study: DesignStudy, names: Sequence[str], count: int) -> dict[str, Floats]:
    """Fractions (k,) of a grid over some dimensions, with their ends; about `count` points."""
    if not names:
        return {"radius": np.zeros(1)}
    sizes: dict[str, int] = {}
    for name in sorted(names, key=lambda n: study.dimensions[n].searched):
        left = count / max(int(np.prod(list(sizes.values()))), 1)
        own = study.dimensions[name]
        points = max(2, int(left ** (1.0 / (len(names) - len(sizes))) + 1e-9))
        if not own.searched:
            points = len(own.values)
        elif name in STEP:
            points = min(points, 1 + round((own.values[1] - own.values[0]) / STEP[name]))
        sizes[name] = points
    axes = []
    for name in names:
        own, points = study.dimensions[name], sizes[name]
        if own.searched and name not in STEP:
            axes.append(np.linspace(0.0, 1.0, points))
        else:
            axes.append((np.arange(points) + 0.5) / points)
    grid = np.meshgrid(*axes, indexing="ij")
    return {name: axis.ravel() for name, axis in zip(names, grid, strict=True)}


def at_fractions(
    study: DesignStudy,
    fractions: Mapping[str, Floats],
    others: Mapping[str, float] | None = None,
) -> dict[str, Floats]:
    """Values (k,) of all dimensions: at fractions, as in `others`, or else the first ones."""
    count = len(next(iter(fractions.values())))
    found = {}
    for name, own in study.dimensions.items():
        if name in fractions:
            found[name] = own.at(fractions[name], STEP.get(name, 0))
        else:
            found[name] = np.full(count, (others or {}).get(name, own.values[0]))
    return found


def tried(
    study: DesignStudy,
    dimensions: Mapping[str, Floats],
    worlds: DrawnWorlds,
    progress: Callable[[int], None] | None = None,
) -> Designs:
    """Designs with these dimensions (k,), on the slips of a sweep."""
    count = len(dimensions["radius"])
    results: dict[str, Floats] = {}

    def keep(block: NDArray[np.int64], found: Outcomes) -> None:
        for key, values in summary(study, found).items():
            results.setdefault(key, np.empty(count))[block] = values

    in_blocks(study, dimensions, worlds, keep, progress)
    return Designs(dict(dimensions), results)


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
    results["lugs_needed"] = quantile_of_worlds(found.lugs, 0.5)
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


def optimised(
    study: DesignStudy,
    worlds: DrawnWorlds,
    start: Designs,
    progress: Callable[[int], None] | None = None,
) -> Designs:
    """Designs of an optimisation from the best of a sweep, by differential evolution.

    It makes the goal's `least` least among designs that meet the goal at its risk, in the same
    worlds as the sweep; where none does, it raises the probability.

    References: Storn and Price, J. Global Optim. 11(4), 1997.
    """
    need("scipy", "design")
    from scipy.optimize import differential_evolution

    names = study.varied
    found = start
    done = 0

    def cost(x: Floats) -> Floats:
        nonlocal found, done
        points = np.atleast_2d(np.asarray(x).T)
        fractions = {name: points[:, i] for i, name in enumerate(names)}
        own = tried(study, at_fractions(study, fractions), worlds)
        found = found.joined(own)
        done += len(points)
        if progress is not None:
            progress(done)
        return _cost(study, own, start)

    best = best_design(study, start)
    first = [_fraction(study, name, float(start.dimensions[name][best])) for name in names]
    differential_evolution(
        cost,
        [(0.0, 1.0)] * len(names),
        x0=first,
        popsize=POPULATION,
        maxiter=GENERATIONS,
        polish=False,
        vectorized=True,
        updating="deferred",
        rng=np.random.default_rng(0),
        tol=1e-3,
    )
    return found


def optimised_count(study: DesignStudy) -> int:
    """Designs that an optimisation tries at most."""
    return max(POPULATION * len(study.varied), 5) * (GENERATIONS + 1)


def _fraction(study: DesignStudy, name: str, value: float) -> float:
    own = study.dimensions[name]
    low, high = own.values[0], own.values[-1]
    if not own.searched:
        return (own.values.index(value) + 0.5) / len(own.values)
    if name in STEP:
        return ((value - low) / STEP[name] + 0.5) / (round((high - low) / STEP[name]) + 1)
    return (value - low) / (high - low)


def _cost(study: DesignStudy, own: Designs, sweep: Designs) -> Floats:
    """Below 1 for designs that meet the goal, by what is to be least; above 1 for others, (k,)."""
    goal = study.goal
    of_sweep = sweep.least_of(goal.least)
    ends = np.nanmin(of_sweep), np.nanmax(np.where(np.isfinite(of_sweep), of_sweep, -np.inf))
    extent = max(float(ends[1] - ends[0]), 1e-12)
    least = np.clip((own.least_of(goal.least) - ends[0]) / extent, -1.0, 1.0)
    shortfall = np.maximum(1.0 - goal.risk - own.results["probability"], 0.0)
    shortfall = shortfall + ~own.lugs_suffice
    return np.asarray(np.where(shortfall > 0.0, 1.0 + shortfall, 0.5 + 0.49 * least))


def meets(study: DesignStudy, designs: Designs) -> NDArray[np.bool_]:
    """Designs (k,) that meet the goal with the probability that its risk leaves."""
    enough = designs.results["probability"] >= 1.0 - study.goal.risk - SAME
    return np.asarray(enough & designs.lugs_suffice)


def best_design(study: DesignStudy, designs: Designs) -> int:
    """The design that meets the goal with the least of what it asks for; else the likeliest one.

    Among equals, the one with the larger margin at the goal's risk.
    """
    found = meets(study, designs)
    margin = designs.results["margin_at_risk_N"]
    if found.any():
        keys = (-margin, designs.least_of(study.goal.least), ~found)
    else:
        keys = (-margin, -designs.results["probability"], ~designs.lugs_suffice)
    return int(np.lexsort(keys)[0])


def pareto_front(study: DesignStudy, designs: Designs) -> NDArray[np.int64]:
    """Designs that no other one beats in both margin at risk and what is to be least, ordered.

    Those whose lugs do not suffice are left out.
    """
    gain = designs.results["margin_at_risk_N"]
    least = designs.least_of(study.goal.least)
    usable = np.flatnonzero(designs.lugs_suffice & np.isfinite(gain) & np.isfinite(least))
    order = usable[np.lexsort((-gain[usable], least[usable]))]
    front: list[int] = []
    highest = -np.inf
    extent = float(np.ptp(gain[usable])) if usable.size else 0.0
    for i in order:
        if gain[i] > highest + SAME * extent:
            front.append(int(i))
            highest = float(gain[i])
    return np.asarray(front, dtype=np.int64)
