"""The monomials of a response that a file for a microcontroller keeps."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats
from training.set_posterior.monomials import ONE, Terms, monomials


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


def _may_go(term: tuple[int, ...], kept: Terms | list[tuple[int, ...]]) -> bool:
    """Whether a term is of second degree or more and divides no other."""
    own = _degrees(term)
    if sum(own.values()) < 2:
        return False
    return not any(
        other != term and all(_degrees(other).get(k, 0) >= power for k, power in own.items())
        for other in kept
    )


def _degrees(term: tuple[int, ...]) -> dict[int, int]:
    return {k: term.count(k) for k in term if k != ONE}
