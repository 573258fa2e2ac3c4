"""Where one parameter lies, from its prior, a mean and a standard deviation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.prior import Prior

Floats = NDArray[np.float64]

#: Places along the prior, steps of Newton's method, and the furthest that one step goes.
PLACES, STEPS, FURTHEST = 2000, 100, 4.0


def quantiles(prior: Prior, mean: float, std: float, below: Floats) -> Floats:
    r"""Fractions of the prior (...) under which shares `below` of what is believed lie.

    .. math:: p(x) \propto p_0(x) \exp(a x + b x^2)

    is the density nearest to the prior p_0 that has this mean and std; it stays inside the prior,
    and is the prior where mean and std are the prior's. Newton's method finds a and b. A mean at
    an end of the prior with a wide std, which no density has, gives the nearest that was reached.
    Reference: Jaynes, Physical Review 106, 1957 (maximum entropy).
    """
    fraction = (np.arange(PLACES) + 0.5) / PLACES
    value = prior.at(fraction)
    x = (value - mean) / max(std, (prior.upper - prior.lower) / PLACES)
    bases = np.stack([x, x**2 - 1.0])
    tilt = np.zeros(2)
    for _ in range(STEPS):
        weight = _weights(tilt @ bases)
        off = bases @ weight
        spread = (bases * weight) @ bases.T - np.outer(off, off)
        step = np.linalg.solve(spread + 1e-9 * np.eye(2), -off)
        tilt = tilt + step * min(1.0, FURTHEST / float(np.abs(step).max() + 1e-300))
        if float(np.abs(off).max()) < 1e-6:
            break
    total = np.cumsum(_weights(tilt @ bases))
    edges = np.concatenate([[0.0], total])
    return np.asarray(np.interp(below, edges, np.arange(PLACES + 1) / PLACES))


def _weights(logs: Floats) -> Floats:
    weight = np.exp(logs - logs.max())
    return np.asarray(weight / weight.sum())
