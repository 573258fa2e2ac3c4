"""A Gaussian process that stands in for a slow function, with its error on points left out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats

#: Bounds of the correlation lengths, as shares of an input's range, and of the variance that
#: neighbours do not explain, as a share of the whole.
LENGTHS, NUGGETS = (0.1, 20.0), (1e-8, 0.1)
#: Points that the lengths are found from: more change them little, and take the cube of the time.
MOST_FITTED = 200
FOLDS = 4  # Parts of the points that are left out in turn
MOST_STEPS = 60  # Steps of the search for the lengths
BLOCK = 4096  # Points that are predicted at a time


@dataclass(frozen=True)
class GaussianEmulator:
    r"""Predictions of k outputs at points of the unit cube.

    .. math::
        \hat y(u) = h(u)^T \beta + k(u)^T K^{-1} (y - H \beta), \quad
        k(u, u') = e^{-\frac12 \sum_i (u_i - u'_i)^2 / l_i^2}, \quad h = (1, u)

    The lengths and the nugget on the diagonal of K are those of largest likelihood, for each output
    by itself.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eqs. 2.41,
    2.42 and 5.8; Sacks, Welch, Mitchell and Wynn, Statist. Sci. 4(4), 1989.

    points: Points (n, d) in the unit cube.
    parts: The process of each output.
    left_out: Error (n, k) at each point of an emulator that was fitted, with its lengths, to three
        quarters of the points without it. That of all points is smaller.
    """

    points: Floats
    parts: tuple[EmulatorPart, ...]
    left_out: Floats

    def __call__(self, u: Floats) -> Floats:
        """Outputs (m, k) at points (m, d)."""
        found = np.empty((len(u), len(self.parts)))
        for start in range(0, len(u), BLOCK):
            own = u[start : start + BLOCK]
            for i, part in enumerate(self.parts):
                found[start : start + BLOCK, i] = part.trend(own) + (
                    part.correlation(own, self.points) @ part.weights
                )
        return found

    @property
    def error(self) -> Floats:
        """Root mean square (k,) of the errors at points left out."""
        return np.asarray(np.sqrt((self.left_out**2).mean(axis=0)))


@dataclass(frozen=True)
class EmulatorPart:
    """The process of one output: lengths (d,), trend (1 + d,), weights (n,)."""

    lengths: Floats
    trend_weights: Floats
    weights: Floats

    def trend(self, u: Floats) -> Floats:
        """The linear trend (m,) at points (m, d)."""
        return np.asarray(_basis(u) @ self.trend_weights)

    def correlation(self, a: Floats, b: Floats) -> Floats:
        """Correlations (m, n) of points (m, d) with points (n, d)."""
        return _correlation(a / self.lengths, b / self.lengths)


def fit_emulator(points: Floats, outputs: Floats) -> GaussianEmulator:
    """The emulator of outputs (n, k) at points (n, d) of the unit cube.

    Outputs must be finite, and n at least 4 (d + 3) / 3. The result depends on the points alone.
    """
    parts = [_fit_part(points, y) for y in outputs.T]
    left = np.empty(outputs.shape)
    fold = np.random.default_rng(0).permutation(len(points)) % FOLDS
    for number in range(FOLDS):
        out = fold == number
        own = tuple(_fit_part(points[~out], y) for y in outputs[~out].T)
        fewer = GaussianEmulator(points[~out], own, left[:0])
        left[out] = outputs[out] - fewer(points[out])
    return GaussianEmulator(points, tuple(parts), left)


def _fit_part(u: Floats, y: Floats) -> EmulatorPart:
    """The process of one output (n,)."""
    spread = float(y.std()) or 1.0
    z = (y - y.mean()) / spread
    chosen = np.linspace(0, len(u) - 1, min(len(u), MOST_FITTED)).astype(int)
    lengths, nugget = _most_likely(u[chosen], z[chosen])
    h = _basis(u)
    k = _correlation(u / lengths, u / lengths) + nugget * np.eye(len(u))
    inverse = np.linalg.inv(k)
    with_h = inverse @ h
    projection = inverse - with_h @ np.linalg.solve(h.T @ with_h, with_h.T)
    weights = projection @ z
    beta = np.linalg.solve(h.T @ with_h, with_h.T @ z)
    trend = np.asarray(spread * beta, dtype=np.float64)
    trend[0] += y.mean()
    return EmulatorPart(lengths, trend, spread * weights)


def _most_likely(u: Floats, z: Floats) -> tuple[Floats, float]:
    """Lengths (d,) and nugget of the largest likelihood, trend and variance integrated out."""
    from scipy.optimize import minimize

    h, squares = _basis(u), (u[:, None, :] - u[None, :, :]) ** 2
    n, d = u.shape

    def cost(x: Floats) -> tuple[float, Floats]:
        precision = np.exp(-2.0 * x[:d])
        smooth = np.exp(-0.5 * squares @ precision)
        k = smooth + math.exp(x[d]) * np.eye(n)
        try:
            factor = np.linalg.cholesky(k)
        except np.linalg.LinAlgError:
            return 1e10, np.zeros(d + 1)
        inverse = np.linalg.inv(k)
        with_h = inverse @ h
        inner = h.T @ with_h
        projection = inverse - with_h @ np.linalg.solve(inner, with_h.T)
        weights = projection @ z
        left = float(z @ weights)
        free = n - h.shape[1]
        log_determinant = float(np.log(np.diag(factor)).sum())
        value = 0.5 * free * math.log(left) + log_determinant
        value += 0.5 * float(np.linalg.slogdet(inner)[1])
        change = 0.5 * (projection - free / left * np.outer(weights, weights))
        by_length = [np.sum(change * smooth * squares[:, :, i]) * precision[i] for i in range(d)]
        by_nugget = np.trace(change) * math.exp(x[d])
        return value, np.asarray([*by_length, by_nugget])

    bounds = [np.log(LENGTHS)] * d + [np.log(NUGGETS)]
    start = np.asarray([0.0] * d + [math.log(1e-6)])
    found = minimize(
        cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": MOST_STEPS}
    )
    return np.exp(found.x[:d]), float(np.exp(found.x[d]))


def _basis(u: Floats) -> Floats:
    return np.column_stack([np.ones(len(u)), u])


def _correlation(a: Floats, b: Floats) -> Floats:
    squares = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2.0 * a @ b.T
    return np.asarray(np.exp(-0.5 * np.maximum(squares, 0.0)))
