"""Monomials and their derivatives."""

import math

import numpy as np
import pytest

from training.set_posterior.monomials import (
    derivative,
    monomial_terms,
    monomials,
)


def test_monomials_are_the_products_that_their_terms_name():
    x = np.asarray([0.5, -2.0, 3.0])
    for term, value in zip(monomial_terms(3, 3), monomials(x, monomial_terms(3, 3)), strict=True):
        assert value == pytest.approx(math.prod(x[k - 1] for k in term if k))


@pytest.mark.parametrize("axis", [1, 2, 3])
def test_the_derivative_is_that_of_finite_differences(axis):
    these, step = monomial_terms(3, 3, 2, 4), 1e-6
    x = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 3))
    move = step * np.eye(3)[axis - 1]
    slope = (monomials(x + move, these) - monomials(x - move, these)) / (2.0 * step)
    found = monomials(x, these) @ derivative(these, axis).T
    if axis == 3:  # the steep terms are of the first two axes alone
        assert np.isfinite(found).all()
    assert found == pytest.approx(slope, abs=1e-8)
