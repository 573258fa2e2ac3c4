"""Polynomials of several coordinates, of low total degree."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Terms = tuple[tuple[int, ...], ...]

#: Stands for the constant 1 in a term.
ONE = 0


def terms(coordinates: int, degree: int, steep: int = 0, steep_degree: int = 0) -> Terms:
    """All monomials up to a degree, as the coordinates (from 1) that are multiplied; 0 pads.

    Of the first `steep` coordinates alone, those up to `steep_degree` too. All have one length.
    """
    length = max(degree, steep_degree)
    chosen = combinations_with_replacement(range(coordinates + 1), length)
    return tuple(
        term for term in chosen if np.count_nonzero(term) <= degree or (max(term) <= steep)
    )


def monomials(x: Floats, these: Terms) -> Floats:
    """Values (..., terms) of the monomials at coordinates x (..., p)."""
    one = np.concatenate([np.ones_like(x[..., :1]), x], axis=-1)
    return np.asarray(np.prod(one[..., np.asarray(these)], axis=-1))


def derivative(these: Terms, coordinate: int) -> Floats:
    """Matrix (terms, terms) D with which the derivative of the monomials b is D b."""
    found = np.zeros((len(these), len(these)))
    for row, term in enumerate(these):
        power = term.count(coordinate)
        if power:
            rest = list(term)
            rest[rest.index(coordinate)] = ONE
            found[row, these.index(tuple(sorted(rest)))] = power
    return found
