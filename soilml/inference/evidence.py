r"""Evidence of a fit: soil, sizes and hyperparameters integrated out.

For a fit at x with Jacobian J and residual r, Gaussian priors of precision P, columns U of the
Gaussian terms and B = [U diag(tau), J], everything is in the Gram matrices of [U, J, r] by channel:

.. math::
    M = \operatorname{diag}(I, P) + B^T V_e^{-1} B, \quad b = B^T V_e^{-1} r - \pi, \quad
    -2 \ln p(y \mid \eta) = r^T V_e^{-1} r - b^T M^{-1} b + \ln|M| + \ln|V_e| - 2 \ln p(\eta)

    \frac{d}{d \ln \tau_g} = 2 \sum_{k \in g} (1 - [M^{-1}]_{kk} - \beta_k^2), \quad
    \frac{d}{d \ln s_c} = 2 (n_c - \mathrm{dof}_c - \mathrm{rss}_c), \quad \beta = M^{-1} b

with half the gradient pi of the priors' -2 ln density. As x is integrated, the hyperparameters eta
at the optimum are those of restricted maximum likelihood with a prior. They are integrated by
Laplace's approximation too, with their expected information.

References: MacKay, Bayesian Interpolation, Neural Computation 4(3), 1992; Patterson and Thompson,
Biometrika 58, 1971; Searle, Casella and McCulloch, Variance Components, 1992, section 6.6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Integers
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.least_squares import Solution
from soilml.inference import constants
from soilml.inference.gaussian_terms import (
    DISCREPANCY,
    SCATTER,
    GaussianTerms,
    Hyperparameters,
)
from soilml.inference.priors import (
    AT_BOUND,
    LOG_2PI,
    WEAK_PRECISION,
    corrections_of_priors,
    prior_of_hyperparameters,
)
from soilml.inference.scatter_elimination import Eliminated, Products
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.numerics.root_finding import Point, bounded_minimum

Booleans = NDArray[np.bool_]

#: Smallest expected information on a hyperparameter that counts, and on one that was never seen.
LEAST_INFORMATION, LEAST_DEGREES = 0.15, 0.5
#: Residual, in standard deviations, of a reading without equilibrium.
NO_EQUILIBRIUM = 1e3
#: Iterations of the search for hyperparameters, and the decrease of -2 ln p that ends it if no more
#: is promised.
ITERATIONS, ENOUGH = 25, 0.01


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A linear model at some hyperparameters."""

    at: Hyperparameters
    value: float  # -2 ln of the evidence with x integrated, bounds ignored
    gradient: Floats  # of it in the logarithms of the hyperparameters
    curvature: Floats  # of half of it in the logarithms of the hyperparameters
    covariance: Floats  # (p, p) of the coordinates, as if none were at a bound
    step: Floats  # (p,) to the optimum under these hyperparameters
    push: Floats  # (p,) gradient of ln p of the coordinates at a bound
    weights: Floats  # (used,) mean weights of the columns, those of scatter apart
    used: Integers  # (used,) numbers of these columns: those that have a variance


@dataclass(frozen=True)
class Evidence:
    """Evidence of a fit, -2 ln p up to a constant that all share.

    promised: What a step from the fit to the optimum gives in the linear model; it counts up to
        `TRUSTED`, the rest only once it was fitted.
    """

    at: Hyperparameters
    value: float
    promised: float

    @property
    def trusted(self) -> float:
        """The evidence without what a long step only promises."""
        return self.value + max(self.promised - constants.TRUSTED, 0.0)


@dataclass(frozen=True, eq=False)
class LinearisedFit:
    """Readings near a fit: Jacobian, residual, and the priors of the coordinates.

    held (p,): Coordinates at a bound, which stay there.
    precision, pull, constant (p,): Of Gaussian priors or what stands for others: precision, half
        the gradient of -2 ln density, and its value.
    information (p, p), cost: Of tests of the soil.
    """

    terms: GaussianTerms
    outliers: Booleans
    coordinates: Sequence[Coordinate]
    x: Floats
    jacobian: Floats
    residual: Floats
    held: Booleans
    precision: Floats
    pull: Floats
    constant: Floats
    information: Floats
    cost: float
    _products: dict[float, Products] = field(default_factory=dict)
    _taken: dict[tuple[float, bytes], Products] = field(default_factory=dict)

    def without(self, outliers: Booleans) -> LinearisedFit:
        """The same model of other readings."""
        return replace(self, outliers=outliers, _products={}, _taken={})

    def products(self, autocorrelation: float) -> Products:
        """Products of the whitened scatter, and of [U, J, r] with the other columns U."""
        if autocorrelation not in self._products:
            white = self.terms.whitened(autocorrelation, ~self.outliers)
            own = np.column_stack([self.jacobian, self.residual])
            own = white.noise[:, None] * own if white.noise.ndim == 1 else white.noise @ own
            self._products[autocorrelation] = white.products_with(self.terms, own)
        return self._products[autocorrelation]

    def eliminated(self, at: Hyperparameters) -> tuple[Integers, Products, Eliminated]:
        """Numbers of the used columns without scatter, products of [U, J, r], and what is left."""
        terms, p = self.terms, len(self.x)
        used = np.flatnonzero(terms.variance(at)[terms.without_scatter] > 0.0)
        key = at.autocorrelation, used.tobytes()
        if key not in self._taken:
            whole = self.products(at.autocorrelation)
            q = whole.others.shape[1] - p - 1
            self._taken[key] = whole.taken(np.append(used, np.arange(q, q + p + 1)))
        found = self._taken[key]
        left = found.eliminated(np.exp(-2.0 * at.log[terms.groups :]), terms.scatter_std(at))
        return terms.without_scatter[used], found, left

    def normal_equations(
        self, at: Hyperparameters
    ) -> tuple[Integers, Products, Eliminated, Floats, Floats, Floats]:
        """What `eliminated` gives; scale (q,), matrix (q, q) and right-hand side (q,) of the rest.

        Unknowns are the weights of the used columns in their standard deviations, `scale`, and then
        the coordinates.
        """
        used, products, left = self.eliminated(at)
        k, p, total = len(used), len(self.x), left.left
        scale = np.concatenate([np.sqrt(self.terms.variance(at)[used]), np.ones(p)])
        matrix = scale[:, None] * total[:-1, :-1] * scale
        matrix[np.arange(k), np.arange(k)] += 1.0
        matrix[k:, k:] += np.diag(self.precision) + self.information
        b = scale * total[:-1, -1]
        b[k:] -= self.pull
        return used, products, left, scale, matrix, b

    def evaluate(self, at: Hyperparameters) -> Evaluation:
        """The model at some hyperparameters.

        Coordinates at a bound stay where they are; the determinant has all.
        """
        from scipy.linalg.lapack import dtrtri

        terms, first = self.terms, self.terms.groups
        used, products, scatter, scale, matrix, b = self.normal_equations(at)
        total, counts, k, p = scatter.left, products.counts, len(used), len(self.x)
        factor = np.linalg.cholesky(matrix)
        root, _ = dtrtri(factor, lower=1)
        inverse = root.T @ root
        beta, held = inverse @ b, np.append(np.zeros(k, bool), self.held)
        if held.any():
            beta = np.zeros(k + p)
            beta[~held] = np.linalg.solve(matrix[np.ix_(~held, ~held)], b[~held])
        prior, gradient, curvature = prior_of_hyperparameters(terms, at)
        value = float(
            total[-1, -1]
            - b @ beta
            + 2.0 * np.log(np.diag(factor)).sum()
            + scatter.log_determinant
            + products.log_determinant
            + 2.0 * counts @ at.log[first:]
            - p * LOG_2PI
            + self.cost
            + self.constant.sum()
            + prior
        )
        of_terms = terms.group[used] >= 0
        change = 2.0 * (1.0 - np.diag(inverse)[:k] - beta[:k] ** 2)
        np.add.at(gradient, terms.group[used][of_terms], change[of_terms])
        # scatter: the inverse is D^-1 + G G^T within runs, and -G root beside the others
        left = np.append(-scale * beta, 1.0)
        tau, weights = scatter.std, scatter.weights(left)
        alone = scatter.root.swapaxes(1, 2) @ scatter.root
        shared = scatter.back[:, :, :-1] * scale @ root.T
        within = alone + shared @ shared.swapaxes(1, 2)
        own = terms.of_kind(SCATTER)
        diagonal = np.diagonal(within, axis1=1, axis2=2)
        gradient[own] += 2.0 * (1.0 - diagonal - weights**2).sum(axis=0)
        runs, others = np.zeros((2, *products.runs.shape[1:])), np.zeros((2, *total.shape))
        s = len(tau)
        runs[0, :, :, :s] = tau[:, None] * within * tau
        runs[0, :, :, s:-1] = -2.0 * tau[:, None] * (shared @ root) * scale
        others[0, :-1, :-1] = scale[:, None] * inverse * scale
        moved = -tau * weights
        runs[1, :, :, :s] = moved[:, :, None] * moved[:, None, :]
        runs[1, :, :, s:] = 2.0 * moved[:, :, None] * left
        others[1] = left[:, None] * left
        weight = np.exp(-2.0 * at.log[first:])
        degrees, squares = weight * products.summed(runs, others).T
        gradient[first:] += 2.0 * (counts - degrees - squares)
        curvature[first:] += 2.0 * np.maximum(counts - degrees, LEAST_DEGREES)
        shrunk = (np.eye(k) - inverse[:k, :k]) ** 2
        for g in np.flatnonzero(~own[:first]):
            of = terms.group[used] == g
            curvature[g] += 2.0 * float(shrunk[np.ix_(of, of)].sum())
        for j, g in enumerate(np.flatnonzero(own)):
            part, rest = shared[:, j], 1.0 - alone[:, j, j]
            square = rest @ (rest - 2.0 * (part**2).sum(axis=1)) + ((part.T @ part) ** 2).sum()
            curvature[g] += 2.0 * float(square)
        push = np.where(self.held, (b - matrix @ beta)[k:], 0.0)
        covariance = inverse[k:, k:]
        return Evaluation(
            at, value, gradient, curvature, covariance, beta[k:], push, beta[:k], used
        )

    def best(self, start: Hyperparameters, iterations: int = ITERATIONS) -> Evaluation:
        """The model at the largest evidence, as far as `start` allows a discrepancy."""
        low, high = np.asarray(self.terms.bounds()).T
        fixed = self.terms.of_kind(DISCREPANCY) & (not start.present)

        def at(log: Floats) -> Point[Evaluation]:
            found = self.evaluate(replace(start, log=log))
            return Point(log, found.value, np.where(fixed, 0.0, found.gradient), found)

        first = at(np.clip(start.log, low, high))
        inverse = np.diag(0.5 / np.maximum(first.found.curvature, LEAST_DEGREES))
        return bounded_minimum(at, first, inverse, (low, high), ENOUGH, iterations).found

    def evidence(self, found: Evaluation) -> Evidence:
        """Evidence with coordinates and hyperparameters integrated out."""
        value = found.value + of_priors(self, found) + self.beside(found.at, found.curvature)
        free = ~self.held
        curvature = np.linalg.inv(found.covariance)[np.ix_(free, free)]
        promised = float(found.step[free] @ curvature @ found.step[free])
        return Evidence(found.at, value, promised)

    def beside(self, at: Hyperparameters, curvature: Floats) -> float:
        """What hyperparameters, outliers and autocorrelation add to -2 ln p of `evaluate`."""
        counted = ~self.terms.of_kind(DISCREPANCY) | at.present
        own = np.maximum(curvature[counted], LEAST_INFORMATION)
        value = float((np.log(own) - LOG_2PI).sum())
        width = self.terms.largest_outlier[self.outliers]
        odds = constants.OUTLIER_PRIOR / (1.0 - constants.OUTLIER_PRIOR)
        strays = (self.residual[self.outliers] / width) ** 2 + 2.0 * np.log(width / odds)
        value += float((strays + LOG_2PI).sum())
        value -= 2.0 * float(np.log(constants.AUTOCORRELATIONS[at.autocorrelation]))
        return value + float(np.count_nonzero(~self.outliers)) * LOG_2PI

    def log_density(self, at: Hyperparameters, left_out: Booleans) -> float:
        r"""ln p of readings given all others: the difference of two evidences.

        .. math:: \ln p(y_o \mid y_r) = \ln p(y) - \ln p(y_r)

        References: Vehtari and Ojanen, Statistics Surveys 6, 2012, section 2 (the log score).
        """
        rest = self.without(self.outliers | left_out)
        return -0.5 * (self.evaluate(at).value - rest.evaluate(at).value)

    def reduced(self, at: Hyperparameters) -> tuple[Floats, float]:
        """Products (p + 1, p + 1) of [J, r] under the covariance at `at`; ln of its determinant.

        With -2 ln of the prior density of the hyperparameters.
        """
        from scipy.linalg import solve_triangular

        terms = self.terms
        used, products, scatter = self.eliminated(at)
        total, k, t = scatter.left, len(used), np.sqrt(terms.variance(at)[used])
        matrix = t[:, None] * total[:k, :k] * t + np.eye(k)
        factor = np.linalg.cholesky(matrix)
        half = solve_triangular(factor, t[:, None] * total[:k, k:], lower=True)
        value = 2.0 * float(np.log(np.diag(factor)).sum())
        value += scatter.log_determinant + products.log_determinant
        value += 2.0 * float(products.counts @ at.log[terms.groups :])
        return total[k:, k:] - half.T @ half, value + prior_of_hyperparameters(terms, at)[0]

    def evidence_with(
        self, products: Floats, constant: float, columns: Integers, first: int
    ) -> tuple[Floats, Floats]:
        """Evidence (n,) of n models of some columns (n, k), and the steps (n, k) of each.

        products, constant: By `reduced`.
        first: Number of the first coordinate whose prior is integrated here; see `of_priors`.
        """
        inner = columns[:, :, None], columns[:, None, :]
        free, one = ~self.held[columns], np.eye(columns.shape[1])
        curvature = products[inner] + self.information[inner]
        curvature += self.precision[columns][:, None, :] * one
        b = products[columns, -1] - self.pull[columns]
        moving = np.where(free[:, :, None] & free[:, None, :], curvature, one)
        step = np.linalg.solve(moving, np.where(free, b, 0.0)[..., None])[..., 0]
        variance = np.diagonal(np.linalg.inv(curvature), axis1=1, axis2=2)
        push = np.where(free, 0.0, b - (curvature @ step[..., None])[..., 0])
        value = products[-1, -1] + constant + self.cost - columns.shape[1] * LOG_2PI
        value = value - (b * step).sum(axis=1) + np.linalg.slogdet(curvature)[1]
        value += self.constant[columns].sum(axis=1)
        further = columns[:, first:], variance[:, first:], step[:, first:], push[:, first:]
        return value + self.corrections(*further).sum(axis=1), step

    def corrections(
        self, numbers: Integers, variance: Floats, step: Floats, push: Floats
    ) -> Floats:
        """-2 ln of the factors (...) by which exact priors of coordinates change the evidence."""
        exact = np.asarray([np.isfinite(c.std) for c in self.coordinates])[numbers]
        found, own = np.zeros(numbers.shape), numbers[~exact]  # a normal prior is exact
        found[~exact] = corrections_of_priors(
            [self.coordinates[i] for i in own],
            self.x[own],
            1.0 / variance[~exact],
            step[~exact],
            push[~exact],
            self.held[own],
        )
        return found


def linear_model(
    terms: GaussianTerms,
    fit: Solution,
    outliers: Booleans,
    extra: Sequence[tuple[Coordinate, Floats]] = (),
) -> LinearisedFit:
    """A fit's neighbourhood, with further coordinates at zero and their columns (m,) of J."""
    coordinates = [*fit.coordinates, *(c for c, _ in extra)]
    jacobian = np.column_stack([fit.derivatives, *(column[:, None] for _, column in extra)])
    x = np.concatenate([fit.x, np.zeros(len(extra))])
    precision, pull, constant = np.zeros(len(x)), np.zeros(len(x)), np.zeros(len(x))
    for i, c in enumerate(coordinates):
        if np.isfinite(c.std):
            precision[i], pull[i] = c.std**-2, x[i] * c.std**-2
            constant[i] = x[i] * pull[i] + 2.0 * np.log(c.std) + LOG_2PI
        else:
            precision[i] = WEAK_PRECISION if c.of_candidate else UNIFORM_PRECISION
    deviation = fit.soil_tests.deviation(fit.x)
    rates = np.zeros((deviation.size, len(x)))
    rates[:, : len(fit.x)] = fit.soil_tests.rates(fit.x)
    lower, upper = (
        np.asarray([getattr(c, end) for c in coordinates]) for end in ("lower", "upper")
    )
    held = (x <= lower + AT_BOUND) | (x >= upper - AT_BOUND)
    held[len(fit.x) :] = False
    residual = fit.measured - fit.prediction
    return LinearisedFit(
        terms=terms,
        outliers=outliers,
        coordinates=coordinates,
        x=x,
        jacobian=jacobian,
        residual=np.where(
            np.isfinite(residual), residual, NO_EQUILIBRIUM * fit.problem.readings.std
        ),
        held=held,
        precision=precision,
        pull=pull + rates.T @ deviation,
        constant=constant,
        information=rates.T @ rates,
        cost=float(deviation @ deviation),
    )


def of_priors(model: LinearisedFit, found: Evaluation) -> float:
    """-2 ln of the factors by which exact priors along each axis differ from their stand-ins."""
    variance = np.diag(found.covariance)
    numbers = np.arange(len(variance))
    return float(model.corrections(numbers, variance, found.step, found.push).sum())
