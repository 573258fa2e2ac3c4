"""Nodes and weights that integrate stresses over a contact.

Stress rises from nothing like a power of the distance to the end of the contact, and the shear
curve bends within a length K: plain Gauss-Legendre converges slowly on both. A change of variable
that crowds the nodes at such ends cures it.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Array, namespace

Nodes = tuple[NDArray[np.float64], NDArray[np.float64]]


@cache
def crowded_start(count: int) -> Nodes:
    """Fractions in (0, 1) and weights, crowded at 0: Gauss-Legendre in u with x = u^3."""
    u, weight = gauss(count)
    return u**3, 3.0 * u**2 * weight


@cache
def crowded_ends(count: int) -> Nodes:
    """Fractions in (0, 1) and weights, crowded at both ends: x = 3 u^2 - 2 u^3."""
    u, weight = gauss(count)
    return 3.0 * u**2 - 2.0 * u**3, 6.0 * u * (1.0 - u) * weight


@cache
def gauss(count: int) -> Nodes:
    """Fractions in (0, 1) and weights of Gauss-Legendre."""
    x, weight = np.polynomial.legendre.leggauss(count)
    return (x + 1.0) / 2.0, weight / 2.0


def columns(nodes: Nodes, like: Array) -> tuple[Array, Array]:
    """Nodes and weights as columns (count, 1) of the array library of `like`."""
    xp = namespace(like)
    x, weight = nodes
    return (
        xp.asarray(x[:, None], dtype=like.dtype, device=like.device),
        xp.asarray(weight[:, None], dtype=like.dtype, device=like.device),
    )


def between(low: Array, inner: list[Array], high: Array, count: int) -> tuple[Array, Array]:
    """Points (points, batch) of parts whose ends are sorted here, and what each represents.

    low, inner, high: Ends of the range and of its parts, in any order between them, (batch,).
    count: Points of each part, crowded at its ends.
    """
    xp = namespace(low)
    ordered = xp.sort(xp.stack(inner, axis=0), axis=0)
    ends = [low, *(ordered[i, :] for i in range(len(inner))), high]
    x, weight = columns(crowded_ends(count), low)
    lengths = [end - start for start, end in pairwise(ends)]
    points = [start + length * x for start, length in zip(ends, lengths, strict=False)]
    shares = [length * weight for length in lengths]
    return xp.concat(points, axis=0), xp.concat(shares, axis=0)
