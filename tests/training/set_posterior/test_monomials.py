"""Monomials and their derivatives."""

import math

import numpy as np
import pytest

from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import constant
from training.set_posterior.monomials import (
    derivative,
    monomial_terms,
    monomials,
    pair_factors,
)
from training.set_posterior.polynomial_residuals import (
    DAMPING_STD,
    PolynomialResiduals,
    ResidualsAtFixedPoints,
)
from training.set_posterior.scale_mixture import OneSystem


def test_there_are_as_many_monomials_as_combinations():
    assert len(monomial_terms(3, 4)) == math.comb(3 + 4, 4)
    assert len(set(monomial_terms(5, 3, 3, 4))) == math.comb(5 + 3, 3) + math.comb(3 + 3, 4)


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


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5, 6])
def test_pairs_of_factors_have_the_product_of_the_monomial(degree):
    terms = monomial_terms(3, degree)
    x = np.random.default_rng(degree).uniform(-1.0, 1.0, 3)
    with_one = np.concatenate([[1.0], x])
    factors = pair_factors(terms)
    products = [math.prod(with_one[a] * with_one[b] for a, b in term) for term in factors]
    assert products == pytest.approx(monomials(x, terms))
    assert len({len(term) for term in factors}) == 1


@pytest.mark.parametrize("degree", [1, 4, 5])
def test_the_misfit_in_the_graph_is_that_of_all_factors_of_the_monomials(degree):
    terms = monomial_terms(2, degree)
    rng = np.random.default_rng(degree)
    system, x = rng.normal(size=(7, len(terms))), rng.uniform(-1.0, 1.0, (5, 2))
    graph = Graph()
    value = constant(graph, system)
    residuals = PolynomialResiduals(value, value, (), terms, (1, 0))
    points = constant(graph, np.concatenate([np.ones((1, 5)), x.T[[1, 0]]]))
    OneSystem(value).misfit(residuals.basis(points)).least.named("misfit")
    found = session_of(graph.model({}, {"misfit": (1, [1, 5])})).run(None, {})[0][0]
    assert found == pytest.approx(((monomials(x, terms) @ system.T) ** 2).sum(axis=1), rel=1e-4)


@pytest.mark.parametrize("degree", [2, 4])
def test_residuals_at_fixed_points_are_those_of_all_monomials(degree):
    """One Gauss-Newton step from 0 and a second one, and the residuals where it ends."""
    terms, order = monomial_terms(3, degree), (2, 0, 1)
    rng, graph = np.random.default_rng(degree), Graph()
    system, others = rng.normal(size=(9, len(terms))), rng.uniform(-1.0, 1.0, (2, 6))
    residuals = PolynomialResiduals.solved_last(constant(graph, system), terms, order)
    along = ResidualsAtFixedPoints.of(residuals, others)
    solved, precision = along.steps(2)
    for name, value in (("s", solved), ("k", precision), ("r", along.residuals(solved))):
        value.node("Identity").named(name)
    along.basis(solved).node("Identity").named("b")
    outputs = {name: (1, [None, 6]) for name in "skrb"}
    found = dict(zip(outputs, session_of(graph.model({}, outputs)).run(None, {}), strict=True))

    def basis_at(s):
        return monomials(np.stack([others[1], s, others[0]], axis=1), terms).T

    s = np.zeros(6)
    for _ in range(2):
        slope = system @ derivative(terms, 2) @ basis_at(s)
        kappa = (slope**2).sum(axis=0) + DAMPING_STD**-2
        s = np.clip(s - (slope * (system @ basis_at(s))).sum(axis=0) / kappa, -1.0, 1.0)
    assert found["s"][0] == pytest.approx(s, abs=1e-5)
    assert found["k"][0] == pytest.approx(kappa, rel=1e-5)
    assert found["b"] == pytest.approx(basis_at(s), abs=1e-5)
    assert found["r"] == pytest.approx(system @ basis_at(s), abs=1e-4)
