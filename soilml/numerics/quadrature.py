"""Nodes and weights that integrate stresses over a contact.

Stress rises from nothing like a power of the distance to the end of the contact, and the shear
curve bends within a length K: plain Gauss-Legendre converges slowly on both. A change of variable
that crowds the nodes at such ends cures it.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Array, namespace

Nodes = tuple[NDArray[np.float64], NDArray[np.float64]]

#: Terms of each series: the first that is left out is below 1e-15 of the sum at an angle of pi, and
#: below 3e-7 in single precision.
TERMS, SINGLE_TERMS = 13, 8
#: Coefficients below this have no effect; some would be subnormal numbers, which are slow.
NEGLIGIBLE = 1e-30


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


def sine_and_versine(nodes: Nodes, angle: Array) -> tuple[Array, Array]:
    r"""Sine, and one less cosine, of the fractions x of each angle.

    .. math::
        \sin(x \alpha) = \sum_{i=0} (-1)^i \frac{x^{2 i + 1}}{(2 i + 1)!} \alpha^{2 i + 1}, \quad
        1 - \cos(x \alpha) = \sum_{i=0} (-1)^i \frac{x^{2 i + 2}}{(2 i + 2)!} \alpha^{2 i + 2}

    Each sum is the product of a matrix of the nodes with one of the powers of the angles, several
    times faster than the functions themselves; both keep their relative accuracy at small angles.

    nodes: The fractions, in [0, 1], from a function of `soilml.numerics.quadrature`.
    angle (parts, batch): Angles (rad) from 0 to pi.

    Returns: Sine and versine, (parts, len(fractions), batch) each.
    """
    xp = namespace(angle)
    count = TERMS if angle.dtype == xp.float64 else SINGLE_TERMS
    of_sine, of_versine = (
        xp.asarray(terms, dtype=angle.dtype, device=angle.device)
        for terms in _coefficients(tuple(nodes[0].tolist()), count)
    )
    square = angle * angle
    powers = [xp.ones_like(angle)]
    for _ in range(count - 1):
        powers.append(powers[-1] * square)
    even = xp.stack(powers, axis=1)  # (parts, terms, batch)
    odd = even * angle[:, None, :]
    return of_sine @ odd, of_versine @ (odd * angle[:, None, :])


@cache
def _coefficients(
    fractions: tuple[float, ...], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coefficients of the powers of an angle in both sums, (len(fractions), count)."""
    x = np.asarray(fractions)[:, None]
    order = np.arange(1, 2 * count + 1)
    factorial = np.cumprod(order.astype(np.float64))
    sign = np.where((order - 1) // 2 % 2 == 0, 1.0, -1.0)
    terms = sign * x**order / factorial
    terms = np.where(np.abs(terms) < NEGLIGIBLE, 0.0, terms)
    return np.ascontiguousarray(terms[:, 0::2]), np.ascontiguousarray(terms[:, 1::2])
