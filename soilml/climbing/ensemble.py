"""Draws from a density on the unit cube."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Walkers, and steps that are thrown away at the start.
WALKERS = 96
FORGOTTEN = 60
#: Largest stretch of a move.
STRETCH = 2.0


def ensemble(
    log_density: Callable[[Floats], Floats],
    start: Floats,
    steps: int,
    rng: np.random.Generator,
) -> Floats:
    """Draws (steps * walkers, p) in (0, 1)^p, by moves along lines between walkers.

    `log_density` takes (n, p) and gives (n,); `start` is (walkers, p). The moves do not care how
    stretched or tilted the density is, so that parameters that trade for one another are drawn
    as well as others. References: Goodman and Weare, Comm. App. Math. Comp. Sci. 5(1), 2010.
    Not for densities with separate peaks that `start` does not cover.
    """
    at, level = start.copy(), log_density(start)
    half, p = len(start) // 2, start.shape[1]
    groups = (slice(0, half), slice(half, 2 * half))
    kept = np.empty((steps, 2 * half, p))
    for step in range(-FORGOTTEN, steps):
        for moved, others in (groups, groups[::-1]):
            partner = at[others][rng.integers(half, size=half)]
            root = np.sqrt(1.0 / STRETCH)
            stretch = (root + rng.random(half) * (1.0 / root - root)) ** 2
            trial = partner + stretch[:, None] * (at[moved] - partner)
            inside = ((trial > 0.0) & (trial < 1.0)).all(axis=1)
            found = np.full(half, -np.inf)
            if inside.any():
                found[inside] = log_density(trial[inside])
            gain = (p - 1) * np.log(stretch) + found - level[moved]
            taken = np.log(rng.random(half)) < gain
            at[moved] = np.where(taken[:, None], trial, at[moved])
            level[moved] = np.where(taken, found, level[moved])
        if step >= 0:
            kept[step] = at
    return kept.reshape(-1, p)
