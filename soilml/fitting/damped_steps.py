"""Bounded Levenberg-Marquardt steps of a least-squares fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.soil_test_terms import SoilTestTerms

Floats = NDArray[np.float64]

#: A parameter whose positive bounds differ by this ratio moves by ratios: valleys of the objective
#: along it and an exponent are straight in its logarithm.
RATIO_OF_BOUNDS = 3.0
#: Largest increase of the logarithm of such a parameter in one step.
MOST_LOG_STEP = 2.0


@dataclass(frozen=True)
class DampedSteps:
    """Steps in the coordinates of a fit: their bounds, priors and curvature.

    Attributes
    ----------
    lower, upper : array (p,)
        Bounds, at which steps end.
    weight : array (p,)
        One over the standard deviation of the Gaussian prior of each coordinate, which has mean
        zero; 0 without a prior.
    offset : array (p,)
        What is added to a coordinate to obtain a multiple of the parameter, where the parameter
        moves by ratios; infinite where it moves by differences.
    tests : SoilTestTerms
        Tests of the soil, which stand beside the residuals.
    """

    lower: Floats
    upper: Floats
    weight: Floats
    offset: Floats
    tests: SoilTestTerms = field(default_factory=SoilTestTerms)

    @staticmethod
    def of(coordinates: Sequence[Coordinate], case: Case | None = None) -> DampedSteps:
        """The steps in these coordinates, with the tests of a case's soil."""
        return DampedSteps(
            np.asarray([c.lower for c in coordinates]),
            np.asarray([c.upper for c in coordinates]),
            np.asarray([1.0 / c.std for c in coordinates]),
            np.asarray([_offset(c) for c in coordinates]),
            SoilTestTerms(case, coordinates),
        )

    def within(self, x: Floats) -> Floats:
        """Coordinates (..., p), moved to the bounds that they are beyond."""
        return np.clip(x, self.lower, self.upper)

    def objective(self, residual: Floats, x: Floats) -> Floats:
        """Sum of squares of residuals (..., m), of priors and of soil tests at x (..., p)."""
        of_prior = ((x * self.weight) ** 2).sum(axis=-1)
        of_tests = (self.tests.deviation(x) ** 2).sum(axis=-1)
        return np.asarray((residual**2).sum(axis=-1) + of_prior + of_tests)

    def are_held(self, x: Floats, residual: Floats, jacobian: Floats) -> bool:
        """Whether bounds hold every coordinate of x (p,) against the descent."""
        return not self._free(x, self._descent(x, residual, jacobian)).any()

    def from_points(self, x: Floats, residual: Floats, jacobian: Floats, damping: Floats) -> Floats:
        r"""Where damped steps lead from several points, (b, p).

        .. math:: (J^T J + P + \lambda\, \mathrm{diag}(J^T J + P))\, \Delta u
            = J^T r - P_0 x - T^T z

        with the deviations z from soil tests, their derivatives T, the precision P_0 of the priors,
        and P = P_0 + T^T T.

        Parameters
        ----------
        x : array (b, p)
            The points.
        residual : array (b, m)
            Whitened residuals at each point.
        jacobian : array (m, p)
            Whitened derivatives of the readings, the same for all points.
        damping : array (b,)
            Factor lambda of each step.
        """
        of_readings = jacobian.T @ jacobian + np.diag(self.weight**2)
        moved = np.empty_like(x)
        for i, point in enumerate(x):
            of_tests = self.tests.rates(point)
            normal = of_readings + of_tests.T @ of_tests
            scale = np.diag(normal) + 1e-9
            descent = self._descent(point, residual[i], jacobian)
            free = self._free(point, descent)
            damped = normal + damping[i] * np.diag(scale)
            step = np.zeros(len(point))
            step[free] = np.linalg.solve(damped[np.ix_(free, free)], descent[free])
            moved[i] = self._moved(point, step)
        return self.within(moved)

    def _descent(self, x: Floats, residual: Floats, jacobian: Floats) -> Floats:
        """Half the negative gradient of the objective, (p,)."""
        of_tests = self.tests.rates(x).T @ self.tests.deviation(x)
        return np.asarray(jacobian.T @ residual - self.weight**2 * x - of_tests)

    def _free(self, x: Floats, descent: Floats) -> NDArray[np.bool_]:
        """The coordinates that no bound holds, (p,)."""
        held = ((x <= self.lower) & (descent < 0)) | ((x >= self.upper) & (descent > 0))
        return np.asarray(~held)

    def _moved(self, x: Floats, step: Floats) -> Floats:
        """Coordinates (p,) after steps (p,): those that move by ratios follow an exponential."""
        multiple = x + self.offset
        with np.errstate(invalid="ignore"):
            growth = np.expm1(np.minimum(step / multiple, MOST_LOG_STEP))
            return np.where(np.isfinite(multiple), x + multiple * growth, x + step)


def _offset(coordinate: Coordinate) -> float:
    prior = coordinate.prior
    positive = prior.lower > 0.0 and prior.upper > RATIO_OF_BOUNDS * prior.lower
    if prior.log or prior.normal_std is not None or not positive:
        return float("inf")
    return prior.lower / (prior.upper - prior.lower)
