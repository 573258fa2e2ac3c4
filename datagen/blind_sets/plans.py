"""The blind sets to simulate: tiers of mechanisms, and sets in which all levels are balanced."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import cycle, groupby, islice
from typing import TypeVar

import numpy as np

# imported for the mechanisms that they declare
from datagen.blind_sets import catalogued, law_families, uncatalogued  # noqa: F401
from datagen.blind_sets.reference_wheel import MECHANISMS, Mechanism
from datagen.blind_sets.soil_families import FAMILIES

#: Mechanisms hidden together that data can distinguish.
PAIRS = (
    ("slip-sinkage", "bulldozing"),
    ("slip-sinkage", "exit-angle"),
    ("grousers", "exit-angle"),
    ("slip-sinkage", "grousers"),
    ("exit-angle", "multipass"),
)

#: Tiers without a mechanism, and the fault of their readings or soil instead.
TIERS_WITHOUT_MECHANISM = {
    "N0": "nothing",
    "N1": "run-to-run scatter of the soil",
    "N2": "autocorrelated noise",
    "N3": "outliers",
    "N4": "more noise than declared",
    "D": "a smooth discrepancy alone",
}


def mechanism_keys(tier: str) -> list[str]:
    """Keys of the mechanisms that a plan of this tier may name; pairs are joined by a plus sign."""
    if tier == "M":
        return ["+".join(pair) for pair in PAIRS]
    return [""] if tier in TIERS_WITHOUT_MECHANISM else list(MECHANISMS[tier])


def active_mechanisms(tier: str, key: str) -> list[Mechanism]:
    """The mechanisms in a plan of this tier; raises `KeyError` for a key that the tier lacks."""
    if tier in TIERS_WITHOUT_MECHANISM:
        return []
    if tier == "M":
        return [MECHANISMS["A"][name] for name in key.split("+")]
    return [MECHANISMS[tier][key]]


T = TypeVar("T")

NOISE_LEVELS = (0.01, 0.02, 0.03)
SIZES = (0.5, 1.0, 2.0)
RUNS = (4, 8, 16)
FREE_COUNTS = (3, 5)
#: Rms of the smooth discrepancy, a fraction of the largest reading.
DISCREPANCIES = (0.0, 0.01, 0.02, 0.04)
#: Scatter of unequal soils over the usual one: 1.5 deg of phi and 15 % of the modulus.
UNEQUAL_SCATTER = 3.0

#: Sets of the benchmark with the design `sweep`: of each mechanism, or of a tier without one, at
#: each of some discrepancies.
SWEEP_COUNTS = {
    "A": (3, DISCREPANCIES),
    "B": (2, DISCREPANCIES),
    "C": (2, DISCREPANCIES),
    "S": (1, DISCREPANCIES),
    "M": (1, DISCREPANCIES),
    "N0": (12, DISCREPANCIES[:1]),
    "N1": (16, DISCREPANCIES[:1]),
    "N2": (8, DISCREPANCIES[:1]),
    "N3": (8, DISCREPANCIES[:1]),
    "N4": (8, DISCREPANCIES[:1]),
    "D": (16, DISCREPANCIES[1:]),
}
#: Sets of the benchmark with another design: with a mechanism of tiers A, B and S, and without.
DESIGN_COUNTS = {
    "one-load": (42, 8),
    "one-run": (16, 4),
    "few-runs": (20, 6),
    "jittered": (16, 4),
    "jittered-one-load": (10, 4),
    "repeats": (16, 6),
    "missing-channels": (20, 6),
    "unequal-soils": (20, 10),
    "braking": (16, 6),
    "two-gears": (16, 4),
}
#: Number of runs, and sizes, of designs that prescribe them.
DESIGN_RUNS = {"one-run": (1,), "few-runs": (2, 3), "few-rows": (1,)}
DESIGN_SIZES = {"few-rows": (1.0, 2.0, 3.0)}

#: Sets beside those above: laws and trends as `SWEEP_COUNTS` has them; the tiers of designs, with
#: how many sets have a mechanism and how many have none.
LATER_SWEEPS = {"L": (2, (0.0, 0.02, 0.04)), "T": (2, DISCREPANCIES[:3])}
LATER_DESIGNS = {
    "few-rows": (("A", "B", "S"), 48, 8),
    "torque-alone": (("A", "B", "C", "S"), 36, 8),
}


@dataclass(frozen=True)
class Plan:
    """The settings of one blind set.

    `cause` is the key of its mechanism in the catalogue, empty in tiers without one. `size` is a
    multiple of the reference size of the mechanism (0 without one), `noise` a fraction of the
    reading, `free` the number of soil parameters that the analyst must identify. `discrepancy` is
    the rms of a smooth difference from any model, in each channel, as a fraction of its largest
    absolute reading. `design` is a key of `run_schedules.DESIGNS`.
    """

    tier: str
    cause: str
    size: float
    noise: float
    runs: int
    soil_family: str
    free: int
    seed: int
    discrepancy: float = 0.0
    design: str = "sweep"

    @property
    def scattered(self) -> bool:
        """Whether the soil differs from run to run: tier N1, half of tier B, unequal soils."""
        return self.scatter > 0.0

    @property
    def timed(self) -> bool:
        """Whether the time of each row was recorded: half of tiers L and T."""
        return self.tier in ("L", "T") and self.seed % 2 == 0

    @property
    def scatter(self) -> float:
        """Scatter of the soil from run to run, relative to the usual one."""
        if self.design == "unequal-soils":
            return UNEQUAL_SCATTER
        return float(self.tier == "N1" or (self.tier == "B" and self.seed % 2 == 0))


def benchmark_plans(seed: int = 0) -> list[Plan]:
    """The plans of the benchmark with discrepancies and designs, about 850.

    Within each tier and design, all levels of noise, size, runs, soil family and number of free
    parameters are equally frequent.
    """
    plans: list[Plan] = []
    for number, (_, group) in enumerate(groupby(_benchmark_cells(seed), lambda c: (c[0], c[3]))):
        cells = list(group)
        generator = np.random.default_rng((seed, 1, number))
        design = cells[0][3]
        noise = _balanced(NOISE_LEVELS, len(cells), generator)
        size = _balanced(DESIGN_SIZES.get(design, SIZES), len(cells), generator)
        runs = _balanced(DESIGN_RUNS.get(design, RUNS), len(cells), generator)
        family = _balanced(tuple(FAMILIES), len(cells), generator)
        free = _balanced(FREE_COUNTS, len(cells), generator)
        for i, (tier, cause, discrepancy, _) in enumerate(cells):
            plans.append(
                Plan(
                    tier=tier,
                    cause=cause,
                    size=size[i] if cause else 0.0,
                    noise=noise[i],
                    runs=runs[i],
                    soil_family=family[i],
                    free=free[i],
                    seed=10_000 * seed + 5_000 + len(plans),
                    discrepancy=discrepancy,
                    design=design,
                )
            )
    return plans


def _benchmark_cells(seed: int) -> Iterator[tuple[str, str, float, str]]:
    """Tier, mechanism, discrepancy and design of every set, sorted by tier within a design."""
    designs = {design: (("A", "B", "S"), *counts) for design, counts in DESIGN_COUNTS.items()}
    yield from _sweep_cells(SWEEP_COUNTS)
    yield from _design_cells(designs, seed, 0)
    yield from _sweep_cells(LATER_SWEEPS)
    yield from _design_cells(LATER_DESIGNS, seed, len(designs))


def _sweep_cells(
    counts: Mapping[str, tuple[int, tuple[float, ...]]],
) -> Iterator[tuple[str, str, float, str]]:
    for tier, (count, discrepancies) in counts.items():
        for cause in mechanism_keys(tier):
            for discrepancy in discrepancies:
                yield from [(tier, cause, discrepancy, "sweep")] * count


def _design_cells(
    designs: Mapping[str, tuple[tuple[str, ...], int, int]], seed: int, first: int
) -> Iterator[tuple[str, str, float, str]]:
    """Sets of designs, whose mechanisms of some tiers are in random order; `first` numbers them."""
    for number, (design, (tiers, with_cause, without)) in enumerate(designs.items(), first):
        generator = np.random.default_rng((seed, 2, number))
        choices = [c for tier in tiers for c in _testable(tier, design)]
        order = [choices[i] for i in generator.permutation(len(choices))]
        usual = cycle(DISCREPANCIES[:3])
        cells = [(*cause, next(usual), design) for cause in islice(cycle(order), with_cause)]
        nulls = cycle([("N0", "", 0.0, design), *(("D", "", d, design) for d in (0.01, 0.02))])
        yield from sorted([*cells, *islice(nulls, without)])


def _testable(tier: str, design: str) -> list[tuple[str, str]]:
    """Mechanisms of a tier that act in a design, as tier and key.

    One run has one value of each covariate. Alternative forms are laws of driving wheels.
    """
    if design == "braking" and tier == "B":
        return []
    keys = mechanism_keys(tier)
    if design in ("one-run", "few-rows"):
        keys = [key for key in keys if not active_mechanisms(tier, key)[0].needs]
    return [(tier, key) for key in keys]


def _balanced(levels: tuple[T, ...], count: int, generator: np.random.Generator) -> list[T]:
    """Levels in random order, each as often as any other, or once more."""
    order = generator.permutation(count) + int(generator.integers(len(levels)))
    return [levels[int(i) % len(levels)] for i in order]
