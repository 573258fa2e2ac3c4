"""The monomials that a small response keeps are those that matter, and divide each other."""

import numpy as np

from training.set_posterior.monomials import monomial_terms, monomials
from training.set_posterior.term_selection import select_terms

ALL = monomial_terms(3, 3)
RNG = np.random.default_rng(0)
X = RNG.uniform(-1.0, 1.0, (200, 3))


def test_the_terms_of_a_sparse_polynomial_are_found():
    some = ((0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 0, 3), (0, 1, 1), (0, 2, 3), (1, 1, 1))
    y = monomials(X, some) @ RNG.normal(1.0, 0.3, (len(some), 5))
    assert set(select_terms(X, y, ALL, len(some))) == set(some)
