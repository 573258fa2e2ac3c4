"""Density of the soil where errors, a discrepancy and an effect are integrated out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import erfc, log, sqrt

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.coordinates import Coordinate, log_ratios, rates_at
from soilml.fitting.covariance import Whitening
from soilml.fitting.least_squares import SoilTestTerms, Solution
from soilml.numerics.importance_sampling import ImportanceSample, importance_sample
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.numerics.surface_sampling import normal_sample, surface_sample
from soilml.numerics.surrogate_density import LogarithmicDensity

MOST_ROUNDS = 5  # Rounds in which polynomials are fitted to the model
TINY = 1e-300  # Smallest share of a normal density whose logarithm is taken
#: Effective sample size where the density is approximated by a normal one.
EFFECTIVE_SIZE = 1250.0


@dataclass(frozen=True)
class SoilDensity:
    r"""Density of the p soil parameters given the rows, linear in all other unknowns.

    .. math::
        \ln p(u | y) = -\tfrac12 r^T S^{-1} r - \tfrac12 \ln \det S, \quad
        r = y - f(u, e^*) + J_e e^*, \quad S = D^2 + C C^T + J_e J_e^T

    with the noise D, the columns C of discrepancy and sensor errors, and the other unknowns e in
    standard deviations, about their optimum e*, with the Jacobian J_e there. The soil itself is not
    linearised. The density over the unit cube of fractions of the priors is complete but for a
    constant that all hypotheses on the same readings share.

    References: Kennedy and O'Hagan, J. R. Statist. Soc. B 63(3), 2001; Tarantola, Inverse Problem
    Theory, 2005, section 3.2 (linearised errors of the theory added to those of the data).

    Attributes
    ----------
    optimum
        The most probable values of soil and other unknowns, the soil first.
    columns
        C (m, q).
    p
        Number of soil parameters.
    noise_scale
        Factor on S, squared: above 1 where residuals exceed all that is known.
    """

    optimum: Solution
    columns: Floats
    p: int
    noise_scale: float = 1.0

    @property
    def free(self) -> list[Coordinate]:
        """The soil parameters."""
        return list(self.optimum.coordinates[: self.p])

    @property
    def others(self) -> list[Coordinate]:
        """The other unknowns."""
        return list(self.optimum.coordinates[self.p :])

    @property
    def std(self) -> Floats:
        """Standard deviations (m,) of the noise."""
        return self.optimum.problem.readings.std

    @cached_property
    def other_columns(self) -> Floats:
        """J_e, changes (m, e) of the readings by one standard deviation of the other unknowns."""
        if not self.others:
            return np.zeros((len(self.std), 0))
        x = self.optimum.x[self.p :]
        stds = np.asarray([c.normal_std for c in self.others], dtype=np.float64)
        per_value = self.optimum.derivatives[:, self.p :] / rates_at(self.others, x)
        return np.asarray(per_value * stds)

    @cached_property
    def offset(self) -> Floats:
        """J_e e*, (m,)."""
        x = self.optimum.x[self.p :]
        at = [
            float(c.prior.at(x[i : i + 1])[0]) / float(c.normal_std or 1.0)
            for i, c in enumerate(self.others)
        ]
        return np.asarray(self.other_columns @ np.asarray(at))

    @cached_property
    def whiten(self) -> Whitening:
        """What makes S one."""
        return Whitening.of(self.std, np.hstack([self.columns, self.other_columns]))

    @cached_property
    def log_determinant(self) -> float:
        """Half of ln det S."""
        size = 1.0 / (1.0 - self.whiten.shrinkage)  # roots of the eigenvalues of D^-1 S D^-1
        return float(np.log(self.std).sum() + np.log(size).sum())

    @cached_property
    def residual(self) -> Floats:
        """Whitened residuals (m,) at the optimum of the soil, all else at zero."""
        left = self.optimum.measured - self.optimum.prediction + self.offset
        return np.asarray(self.whiten @ left)

    @cached_property
    def jacobian(self) -> Floats:
        """Whitened derivatives (m, p) by the soil."""
        return np.asarray(self.whiten @ self.optimum.derivatives[:, : self.p])

    @property
    def squares(self) -> float:
        """Sum of squared residuals at the optimum, in variances of all that is known."""
        return float(self.residual @ self.residual)

    @cached_property
    def precision(self) -> Floats:
        """Precision (p, p) of the normal density that is closest, the priors' variances in it."""
        rates = self._tests.rates(self.optimum.x[: self.p])
        information = self.jacobian.T @ self.jacobian / self.noise_scale**2
        return np.asarray(information + rates.T @ rates + UNIFORM_PRECISION * np.eye(self.p))

    @property
    def log_evidence(self) -> float:
        """Logarithm of the integral of the density over the cube, by Laplace's approximation."""
        deviation = self._tests.deviation(self.optimum.x[: self.p])
        at_optimum = -0.5 * self.squares / self.noise_scale**2 - self.log_determinant
        volume = 0.5 * self.p * np.log(2.0 * np.pi) - 0.5 * np.linalg.slogdet(self.precision)[1]
        return float(at_optimum - 0.5 * deviation @ deviation + volume)

    def gain(self, signature: Floats, size: float, sign: int) -> tuple[float, float]:
        r"""Log evidence of one more effect over this density's, and its expected size.

        .. math::
            \ln \frac{p(y | h, k)}{p(y | h)} = \frac{b^2}{2 (a + \sigma^{-2})}
            - \tfrac12 \ln(1 + a \sigma^2), \quad a = s^T M s, \; b = s^T M r

        linearised, with the signature s of a size of one and M the inverse covariance beside the
        soil. A size that has one sign has half the normal density.

        signature (m,): Change of the readings by a size of one.
        size: Standard deviation of the size about zero.
        sign: 1 or -1 where the size has one sign, else 0.
        """
        column = self.whiten @ signature
        moved = np.linalg.solve(self.precision, self.jacobian.T @ column)
        beside = column - self.jacobian @ moved
        precision = float(beside @ column) + size**-2
        expected = float(beside @ self.residual) / precision
        gain = 0.5 * precision * expected**2 - 0.5 * float(np.log(precision * size**2))
        if sign:
            share = erfc(-sign * expected * sqrt(precision / 2.0))  # twice that of the sign
            gain += log(max(share, TINY))
        return gain, expected

    @property
    def _tests(self) -> SoilTestTerms:
        return SoilTestTerms(self.optimum.case, self.free)

    def predict(self, u: Floats) -> Floats:
        """Readings (sets, m) of soils u (sets, p), all else at its optimum; and test deviations."""
        others = np.broadcast_to(self.optimum.x[self.p :], (len(u), len(self.others)))
        y = self.optimum.problem.predict(np.hstack([u, others]))
        return np.hstack([y, self._tests.deviation(u)])

    def of_predictions(self, y: Floats) -> Floats:
        """Log density (sets,) of soils for which `predict` is y."""
        m = len(self.std)
        white = self.whiten @ (self.optimum.measured - y[:, :m] + self.offset).T
        logs = -0.5 * (white**2).sum(axis=0) / self.noise_scale**2 - self.log_determinant
        logs = logs - 0.5 * (y[:, m:] ** 2).sum(axis=1)
        return np.where(np.isfinite(logs), logs, -np.inf)

    def sample(self) -> ImportanceSample:
        """Weighted samples, with polynomials in place of the model; else of the normal density."""
        logs = LogarithmicDensity(self, log_ratios(self.free))
        root = np.linalg.cholesky(np.linalg.inv(self.precision))
        start = normal_sample(*logs.around(self.optimum.x[: self.p], root))
        found = surface_sample(logs, self.p, start, most_rounds=MOST_ROUNDS)
        return self._of_normal() if found is None else logs.back(found)

    def _of_normal(self) -> ImportanceSample:
        """Samples of the linearised density in the cube."""
        x = self.optimum.x[: self.p]
        within = self.precision - UNIFORM_PRECISION * np.eye(self.p)
        rates, deviation = self._tests.rates(x), self._tests.deviation(x)
        slope = self.jacobian.T @ self.residual / self.noise_scale**2 - rates.T @ deviation
        top = -0.5 * self.squares / self.noise_scale**2 - self.log_determinant
        top -= 0.5 * float(deviation @ deviation)

        def log_density(u: Floats) -> Floats:
            away = u - x
            return np.asarray(top + away @ slope - 0.5 * ((away @ within) * away).sum(axis=1))

        return importance_sample(log_density, self.p, least_effective_size=EFFECTIVE_SIZE)
