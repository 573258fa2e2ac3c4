"""Polynomials of several variables, fitted to outputs of a model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Scaling:
    """Affine change to variables of mean zero and unit covariance: u = centre + root z."""

    centre: Floats  # (p,)
    root: Floats  # (p, p), a root of the covariance

    @staticmethod
    def of(u: Floats, weights: Floats) -> Scaling:
        """From points (n, p) and their weights (n,), which sum to one."""
        centre = weights @ u
        covariance = ((u - centre).T * weights) @ (u - centre)
        least = 1e-10 * np.trace(covariance) + 1e-20
        return Scaling(centre, np.linalg.cholesky(covariance + least * np.eye(len(centre))))

    def __call__(self, u: Floats) -> Floats:
        """Scaled points (n, p)."""
        return np.asarray(np.linalg.solve(self.root, (u - self.centre).T).T)

    def back(self, z: Floats) -> Floats:
        """Points (n, p) from scaled ones."""
        return np.asarray(self.centre + z @ self.root.T)


@dataclass(frozen=True)
class PolynomialSurface:
    """Polynomials of one total degree in scaled variables, for each of k outputs."""

    scaling: Scaling
    degree: int
    coefficients: Floats  # (terms, k)

    def __call__(self, u: Floats) -> Floats:
        """Outputs (n, k) at points (n, p)."""
        return np.asarray(monomials(self.scaling(u), self.degree) @ self.coefficients)


def fit_surface(
    scaling: Scaling, degree: int, u: Floats, y: Floats
) -> tuple[PolynomialSurface, Floats]:
    r"""Least-squares polynomials, and their leave-one-out errors (n, k) at the points.

    .. math:: y_i - \hat y_{-i}(u_i) = \frac{y_i - \hat y(u_i)}{1 - h_{ii}}

    with the diagonal h of the projection on the monomials.

    Parameters
    ----------
    scaling
        Of the variables.
    degree
        Total degree; there must be more points than monomials.
    u, y
        Points (n, p) and outputs (n, k).

    References
    ----------
    Hastie, Tibshirani and Friedman, The Elements of Statistical Learning, 2009, eq. 7.64.
    """
    basis = monomials(scaling(u), degree)
    q, r = np.linalg.qr(basis)
    projected = q.T @ y
    coefficients = np.linalg.lstsq(r, projected, rcond=1e-12)[0]
    left = 1.0 - np.einsum("ij,ij->i", q, q)
    errors = (y - q @ projected) / np.maximum(left, 1e-9)[:, None]
    return PolynomialSurface(scaling, degree, coefficients), np.asarray(errors)


def term_count(p: int, degree: int) -> int:
    """Number of monomials of p variables up to a total degree."""
    return len(_products(p, degree)) + 1


def monomials(z: Floats, degree: int) -> Floats:
    """All monomials (n, terms) of points z (n, p) up to a total degree, the constant first."""
    products = _products(z.shape[1], degree)
    columns = np.empty((len(products) + 1, len(z)))
    columns[0] = 1.0
    for number, (shorter, variable) in enumerate(products, start=1):
        np.multiply(columns[shorter], z[:, variable], out=columns[number])
    return columns.T


@cache
def _products(p: int, degree: int) -> tuple[tuple[int, int], ...]:
    """Each monomial but the constant as an earlier one, by its number, times a variable."""
    numbers: dict[tuple[int, ...], int] = {(): 0}
    products = []
    for total in range(1, degree + 1):
        for variables in combinations_with_replacement(range(p), total):
            numbers[variables] = len(numbers)
            products.append((numbers[variables[:-1]], variables[-1]))
    return tuple(products)
