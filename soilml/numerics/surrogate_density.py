"""A density whose model is replaced by polynomials, in a box of the unit cube or in logarithms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations_with_replacement
from math import sqrt
from typing import Protocol

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.importance_sampling import ImportanceSample, importance_sample
from soilml.numerics.resampling import systematic_resampling

#: A region ends so many standard deviations from its middle, unless the density goes on beyond.
REACH = 4.5
#: Farthest from the middle that polynomials are used, in standard deviations: the corners of a box
#: of many dimensions are far beyond the points that they were fitted to.
FARTHEST = 8.0
MANY_DIMENSIONS = 5  # Dimensions from which on the first samples are drawn about the middle
BLOCK = 100_000  # Most predictions that are held at once: few enough to stay in a processor's cache
TRIALS = 256  # Trials of the error of the log density


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

    scaling: Of the variables.
    degree: Total degree; there must be more points than monomials.
    u, y: Points (n, p) and outputs (n, k).

    References: Hastie, Tibshirani and Friedman, The Elements of Statistical Learning, 2009, eq.
    7.64.
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


class ModelDensity(Protocol):
    """A density over the unit cube that depends on a model's predictions."""

    def predict(self, u: Floats, /) -> Floats:
        """Predictions (n, k) at points (n, p); NaN where there are none."""
        ...

    def of_predictions(self, y: Floats, /) -> Floats:
        """Logarithm (n,) of the density, up to a constant, where the model predicts y (n, k)."""
        ...


@dataclass(frozen=True)
class SamplingBox:
    """A box in the unit cube, along the axes of a scaling; it may stand out of the cube."""

    scaling: Scaling
    half_width: float  # in standard deviations

    @staticmethod
    def cube(p: int) -> SamplingBox:
        """The whole cube: a uniform distribution ends at the root of three standard deviations."""
        return SamplingBox(Scaling(np.full(p, 0.5), np.eye(p) / sqrt(12.0)), sqrt(3.0))

    @staticmethod
    def of(samples: ImportanceSample, reach: float = REACH) -> SamplingBox:
        """The box about the middle of samples."""
        return SamplingBox(Scaling.of(samples.u, samples.weights), reach)

    def points(self, fractions: Floats) -> Floats:
        """Points (n, p) of the cube's space at fractions (n, p) of the box."""
        return self.scaling.back((2.0 * fractions - 1.0) * self.half_width)

    def distance(self, u: Floats) -> Floats:
        """Distance (n,) of points (n, p) from the middle, in standard deviations."""
        return np.asarray(np.sqrt((self.scaling(u) ** 2).sum(axis=1)))

    def share_at_faces(self, samples: ImportanceSample) -> float:
        """Probability of the outermost twentieth of the box."""
        outmost = np.abs(self.scaling(samples.u)).max(axis=1) > 0.95 * self.half_width
        return float(samples.weights[outmost].sum())

    @property
    def middle(self) -> tuple[Floats, Floats]:
        """The middle (p,) of fractions of the box, and a root (p, p): one standard deviation."""
        p = len(self.scaling.centre)
        return np.full(p, 0.5), 0.5 / self.half_width * np.eye(p)

    @property
    def log_volume(self) -> float:
        """Logarithm of the volume of the box."""
        p = len(self.scaling.centre)
        return float(p * np.log(2.0 * self.half_width) + np.linalg.slogdet(self.scaling.root)[1])


@dataclass(frozen=True)
class SurrogateDensity:
    """A power of a density in a region, with polynomials in place of its model."""

    density: ModelDensity
    region: SamplingBox
    surface: PolynomialSurface
    power: float = 1.0

    def __call__(self, u: Floats) -> Floats:
        """Its logarithm (n,) at points (n, p)."""
        size = max(BLOCK // self.surface.coefficients.shape[1], 1)
        logs = np.empty(len(u))
        for start in range(0, len(u), size):
            y = self.surface(u[start : start + size])
            logs[start : start + size] = self.density.of_predictions(y)
        return self.power * logs

    def sample(self, least_effective_size: float) -> ImportanceSample:
        """Weighted samples of it; see `importance_sample`."""

        def log_density(fractions: Floats) -> Floats:
            u = self.region.points(fractions)
            inside = np.all((u > 0.0) & (u < 1.0), axis=1)
            inside &= self.region.distance(u) < FARTHEST
            logs = np.full(len(u), -np.inf)
            logs[inside] = self(u[inside])
            return logs

        p = len(self.region.scaling.centre)
        many = p >= MANY_DIMENSIONS
        found = importance_sample(
            log_density,
            p,
            least_effective_size=least_effective_size,
            around=self.region.middle if many else None,
        )
        kept = found.weights > 0.0
        return ImportanceSample(
            self.region.points(found.u[kept]),
            found.weights[kept],
            found.evidence + self.region.log_volume,
        )

    def error_under(
        self, samples: ImportanceSample, errors: Floats, rng: np.random.Generator
    ) -> float:
        """Standard deviation of the error of its logarithm under samples of it.

        The predictions err by any of `errors` (n, k), chosen at random.
        """
        chosen = systematic_resampling(samples.weights, TRIALS, rng.random())
        y = self.surface(samples.u[chosen])
        wrong = y + errors[rng.integers(len(errors), size=TRIALS)]
        change = self.density.of_predictions(wrong) - self.density.of_predictions(y)
        return float(self.power * np.std(change))


@dataclass(frozen=True)
class LogarithmicDensity:
    r"""A density over u in fractions v of the logarithm of some variables.

    A variable that is uniform between two positive bounds of ratio R has

    .. math:: u = \frac{R^v - 1}{R - 1}, \qquad \frac{du}{dv} = \frac{R^v \ln R}{R - 1}

    The logarithm of the rate stands behind the predictions as one more, so that it is a factor of
    the density: it is linear in v, and polynomials describe it exactly. Powers of a variable, such
    as a pressure that a modulus and an exponent make together, are closer to polynomials in v, and
    a density along which they are constant is less bent.

    Attributes
    ----------
    density
        The density over u (n, p).
    ratio
        R (p,); one for a variable that stays.
    """

    density: ModelDensity
    ratio: Floats

    def linear(self, v: Floats) -> Floats:
        """u (n, p) of v (n, p)."""
        some, ratio = self.ratio != 1.0, np.where(self.ratio != 1.0, self.ratio, 2.0)
        return np.where(some, (ratio**v - 1.0) / (ratio - 1.0), v)

    def logarithmic(self, u: Floats) -> Floats:
        """v (n, p) of u (n, p)."""
        some, ratio = self.ratio != 1.0, np.where(self.ratio != 1.0, self.ratio, 2.0)
        return np.where(some, np.log1p(u * (ratio - 1.0)) / np.log(ratio), u)

    def log_rate(self, v: Floats) -> Floats:
        """Logarithm (n,) of the product of the rates du/dv."""
        own = self.ratio[self.ratio != 1.0]
        each = v[:, self.ratio != 1.0] * np.log(own) + np.log(np.log(own) / (own - 1.0))
        return np.asarray(each.sum(axis=1))

    def predict(self, v: Floats) -> Floats:
        """Predictions (n, k + 1) at points (n, p), the logarithm of the rates the last."""
        return np.column_stack([self.density.predict(self.linear(v)), self.log_rate(v)])

    def of_predictions(self, y: Floats) -> Floats:
        """Logarithm (n,) of the density over v where the model predicts y (n, k + 1)."""
        return np.asarray(self.density.of_predictions(y[:, :-1]) + y[:, -1])

    def __call__(self, v: Floats) -> Floats:
        """Logarithm (n,) of the density over v (n, p)."""
        return self.of_predictions(self.predict(v))

    def back(self, sample: ImportanceSample) -> ImportanceSample:
        """Samples of u from samples of v."""
        return replace(sample, u=self.linear(sample.u))

    def forth(self, sample: ImportanceSample) -> ImportanceSample:
        """Samples of v from samples of u."""
        return replace(sample, u=self.logarithmic(sample.u))

    def around(self, x: Floats, root: Floats) -> tuple[Floats, Floats]:
        """Middle (p,) and root (p, p) of a covariance over v from those over u, linearised."""
        v = self.logarithmic(x)
        own = np.where(self.ratio != 1.0, self.ratio, np.e)
        rate = np.where(self.ratio != 1.0, own**v * np.log(own) / (own - 1.0), 1.0)
        return v, root / rate[:, None]
