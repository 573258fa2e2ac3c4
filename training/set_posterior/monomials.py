"""Polynomials of several coordinates of low total degree, and the terms of a small file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations_with_replacement

import numpy as np

from soilml.arrays import Floats

#: Monomials, each as the coordinates (counted from 1) that are multiplied; 0 stands for the factor
#: 1.
Terms = tuple[tuple[int, ...], ...]

ONE = 0  # The factor 1 of a monomial


def monomial_terms(
    coordinates: int, degree: int, leading: int = 0, leading_degree: int = 0
) -> Terms:
    """All monomials of some coordinates up to a total degree.

    coordinates: Number of coordinates.
    degree: Largest total degree of a monomial of any coordinates.
    leading, leading_degree: Monomials of the first `leading` coordinates alone are included up to
        this degree.

    Returns: One ascending tuple for each monomial, all of length `max(degree, leading_degree)`;
    `ONE` fills monomials of a lower degree.

    Examples
    --------
    >>> monomial_terms(2, 2)
    ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    """
    length = max(degree, leading_degree)
    candidates = combinations_with_replacement(range(coordinates + 1), length)
    return tuple(
        term for term in candidates if np.count_nonzero(term) <= degree or (max(term) <= leading)
    )


def monomials(x: Floats, terms: Terms) -> Floats:
    """Values (..., terms) of the monomials at coordinates x (..., p)."""
    with_one = np.concatenate([np.ones_like(x[..., :1]), x], axis=-1)
    return np.asarray(np.prod(with_one[..., np.asarray(terms)], axis=-1))


def derivative(terms: Terms, coordinate: int) -> Floats:
    """Matrix (terms, terms) D with which the derivative of the monomials b is D b."""
    matrix = np.zeros((len(terms), len(terms)))
    for row, term in enumerate(terms):
        power = term.count(coordinate)
        if power:
            factors = list(term)
            factors[factors.index(coordinate)] = ONE
            matrix[row, terms.index(tuple(sorted(factors)))] = power
    return matrix


def select_terms(x: Floats, y: Floats, terms: Terms, count: int) -> Terms:
    r"""The `count` terms that are left when the least useful one is taken out again and again.

    The least useful term is that whose removal raises the squared error of the least-squares
    polynomials least. With the coefficients beta of a fit with basis B, it raises it by

    .. math:: \frac{\sum \beta_j^2}{[(B^T B)^{-1}]_{jj}}

    Constant and linear terms stay, and a term stays as long as it divides another one, so that the
    derivatives of all terms are multiples of terms.

    x: Points (m, p) of the unknowns.
    y: Values (m, k) of all responses there, each divided by what an error of it weighs.

    References: Miller, Subset Selection in Regression, 2002, section 3.3 (backward elimination).
    """
    kept = list(terms)
    while len(kept) > count:
        basis = monomials(x, tuple(kept))
        inverse = np.linalg.inv(basis.T @ basis)
        cost = ((inverse @ (basis.T @ y)) ** 2).sum(axis=1) / np.diag(inverse)
        free = [i for i, term in enumerate(kept) if _may_go(term, kept)]
        kept.pop(min(free, key=lambda i: float(cost[i])))
    return tuple(kept)


def _may_go(term: tuple[int, ...], kept: Sequence[tuple[int, ...]]) -> bool:
    """Whether a term is of second degree or more and divides no other."""
    own = Counter(term)
    del own[ONE]
    if own.total() < 2:
        return False
    return not any(other != term and own <= Counter(other) for other in kept)
