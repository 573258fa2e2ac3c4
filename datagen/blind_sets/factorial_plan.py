"""Which hidden sets are drawn: a balanced part of all there could be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from datagen.blind_sets.catalogue import keys
from datagen.blind_sets.soil_families import FAMILIES

NOISE = (0.01, 0.02, 0.03)
SIZES = (0.5, 1.0, 2.0)
RUNS = (4, 8, 16)
FREES = (3, 5)

#: Blocks of nine plans for each cause of a tier.
BLOCKS = {"A": 4, "B": 3, "C": 3, "S": 2, "M": 3, "N0": 8, "N1": 8, "N2": 6, "N3": 6, "N4": 4}
#: How many plans of a tier a quick look takes.
FEW = {"A": 15, "B": 6, "C": 3, "S": 4, "M": 3, "N0": 2, "N1": 2, "N2": 2, "N3": 2, "N4": 1}


@dataclass(frozen=True)
class Plan:
    """One hidden set before it is drawn.

    `size` is times the reference size of the cause (0 where nothing is hidden), `noise` a share of
    the reading, `free` how many soil parameters the analyst must find.
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


def matrix(full: bool, seed: int = 0) -> list[Plan]:
    """The plans of the benchmark: all of them, or few for a quick look.

    Each cause gets blocks of nine, orthogonal in noise, size, runs and soil family (Taguchi's L9),
    with the levels relabelled from block to block, so that within a cause every two factors meet
    in all their levels equally often; three and five free parameters alternate.
    """
    plans: list[Plan] = []
    for tier, blocks in BLOCKS.items():
        for cause in keys(tier):
            generator = np.random.default_rng((seed, len(plans)))
            for block in range(blocks):
                plans += _block(tier, cause, block, 10_000 * seed + len(plans), generator)
    return plans if full else _few(plans)


def _block(
    tier: str, cause: str, block: int, seed: int, generator: np.random.Generator
) -> list[Plan]:
    levels = [generator.permutation(3) for _ in range(4)]
    rows = [(i, j, (i + j) % 3, (i + 2 * j) % 3) for i in range(3) for j in range(3)]
    made = []
    for place, row in enumerate(generator.permutation(9)):
        noise, size, runs, family = (int(levels[k][rows[row][k]]) for k in range(4))
        made.append(
            Plan(
                tier=tier,
                cause=cause,
                size=0.0 if tier.startswith("N") else SIZES[size],
                noise=NOISE[noise],
                runs=RUNS[runs],
                soil_family=list(FAMILIES)[family],
                free=FREES[(int(row) + block) % 2],
                seed=seed + place,
            )
        )
    return made


def _few(plans: list[Plan]) -> list[Plan]:
    """As many plans of each tier as `FEW` says, spread over its causes."""
    chosen = []
    for tier, count in FEW.items():
        own = [plan for plan in plans if plan.tier == tier]
        chosen += [own[i * len(own) // count + i % 9] for i in range(count)]
    return chosen
