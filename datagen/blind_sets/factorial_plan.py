"""The blind sets to simulate: a balanced fraction of the full factorial."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from datagen.blind_sets.catalogue import mechanism_keys
from datagen.blind_sets.soil_families import FAMILIES

NOISE_LEVELS = (0.01, 0.02, 0.03)
SIZES = (0.5, 1.0, 2.0)
RUNS = (4, 8, 16)
FREE_COUNTS = (3, 5)

#: Number of blocks of nine plans for each mechanism of a tier.
BLOCK_COUNTS = {"A": 4, "B": 3, "C": 3, "S": 2, "M": 3, "N0": 8, "N1": 8, "N2": 6, "N3": 6, "N4": 4}
#: Number of plans of each tier in the quick selection.
QUICK_COUNTS = {
    "A": 15,
    "B": 6,
    "C": 3,
    "S": 4,
    "M": 3,
    "N0": 2,
    "N1": 2,
    "N2": 2,
    "N3": 2,
    "N4": 1,
}


@dataclass(frozen=True)
class Plan:
    """The settings of one blind set.

    `cause` is the key of its mechanism in the catalogue, empty in tiers without one. `size` is a
    multiple of the reference size of the mechanism (0 without one), `noise` a fraction of the
    reading, `free` the number of soil parameters that the analyst must identify.
    """

    tier: str
    cause: str
    size: float
    noise: float
    runs: int
    soil_family: str
    free: int
    seed: int

    @property
    def scattered(self) -> bool:
        """Whether the soil differs from run to run: tier N1, and half of tier B."""
        return self.tier == "N1" or (self.tier == "B" and self.seed % 2 == 0)


def plan_matrix(full: bool, seed: int = 0) -> list[Plan]:
    """The plans of the benchmark: all of them, or a quick selection.

    Each mechanism gets blocks of nine plans, orthogonal in noise, size, runs and soil family
    (Taguchi's L9). The levels are permuted from block to block, so that within a mechanism all
    combinations of levels of two factors are equally frequent; three and five free parameters
    alternate.
    """
    plans: list[Plan] = []
    for tier, blocks in BLOCK_COUNTS.items():
        for cause in mechanism_keys(tier):
            generator = np.random.default_rng((seed, len(plans)))
            for block in range(blocks):
                plans += _block(tier, cause, block, 10_000 * seed + len(plans), generator)
    return plans if full else _quick_selection(plans)


def _block(
    tier: str, cause: str, block: int, seed: int, generator: np.random.Generator
) -> list[Plan]:
    levels = [generator.permutation(3) for _ in range(4)]
    rows = [(i, j, (i + j) % 3, (i + 2 * j) % 3) for i in range(3) for j in range(3)]
    plans = []
    for position, row in enumerate(generator.permutation(9)):
        noise, size, runs, family = (int(levels[k][rows[row][k]]) for k in range(4))
        plans.append(
            Plan(
                tier=tier,
                cause=cause,
                size=0.0 if tier.startswith("N") else SIZES[size],
                noise=NOISE_LEVELS[noise],
                runs=RUNS[runs],
                soil_family=list(FAMILIES)[family],
                free=FREE_COUNTS[(int(row) + block) % 2],
                seed=seed + position,
            )
        )
    return plans


def _quick_selection(plans: list[Plan]) -> list[Plan]:
    """`QUICK_COUNTS` plans of each tier, spread over its mechanisms."""
    chosen = []
    for tier, count in QUICK_COUNTS.items():
        own = [plan for plan in plans if plan.tier == tier]
        chosen += [own[i * len(own) // count + i % 9] for i in range(count)]
    return chosen
