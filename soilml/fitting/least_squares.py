"""Least squares on the full model: the problem, and the solution that a descent finds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate, rates_at, values_at
from soilml.fitting.covariance import Whitening
from soilml.fitting.predictions import Linearisation, linearise, predict
from soilml.fitting.readings import Readings
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.physics.sinkage_estimate import SinkageEstimate
from soilml.physics.soils.soil_tests import deviation_rates, deviations

#: Residual, in standard deviations, of a reading without equilibrium at a trial: large enough that
#: the trial is rejected, finite so that trials can still be compared.
NO_EQUILIBRIUM = 1e3


@dataclass(frozen=True)
class SoilTestTerms:
    """Deviations of the soil from the tests of a case, at coordinates of a fit.

    Each is a residual of unit variance beside those of the readings. It has neither discrepancy nor
    scatter from run to run: its own scatter contains that from place to place.
    """

    case: Case | None = None
    coordinates: Sequence[Coordinate] = ()

    def deviation(self, x: Floats) -> Floats:
        """Deviations (..., t) at coordinates x (..., p), in standard deviations."""
        if self.case is None or not self.case.soil_tests:
            return np.zeros((*x.shape[:-1], 0))
        names = [c.path for c in self.coordinates]
        values = values_at(self.coordinates, x)
        return deviations(self.case.soil_tests, self.case.soil, names, values)

    def rates(self, x: Floats) -> Floats:
        """Derivatives (t, p) of the deviations at coordinates x (p,)."""
        if self.case is None or not self.case.soil_tests:
            return np.zeros((0, len(x)))
        names = [c.path for c in self.coordinates]
        values, rates = values_at(self.coordinates, x), rates_at(self.coordinates, x)
        return deviation_rates(self.case.soil_tests, self.case.soil, names, values) * rates


@dataclass(frozen=True)
class LeastSquaresProblem:
    r"""Readings y with covariance, and the case that is fitted to them.

    .. math:: \min_x \|W (y - f(x))\|^2 + \sum_k (\theta_k(x) / \sigma_k)^2 + \sum_i z_i(x)^2

    with the whitening W, normal densities of sizes of effects about zero, and the deviations z from
    tests of the soil. `priors` adds those of the soil parameters: of normal priors, or of all as
    Gaussian ones. For `gap` all are uniform in the coordinate.
    """

    case: Case
    coordinates: Sequence[Coordinate]
    readings: Readings
    whiten: Whitening | Floats  # (m, m) in either form, or (k, m) of some of the readings
    priors: Literal["", "normal", "all"] = ""

    @cached_property
    def soil_tests(self) -> SoilTestTerms:
        """Deviations from tests of the soil."""
        return SoilTestTerms(self.case, self.coordinates)

    @cached_property
    def normal_std(self) -> Floats:
        """Standard deviation (p,) of normal priors of the value about zero; infinite without."""
        known = [c.prior.normal_std or np.inf for c in self.coordinates]
        return np.asarray(known if self.priors else [np.inf] * len(known), float)

    @cached_property
    def _gaussian(self) -> tuple[Floats, Floats]:
        """Middle and root of the precision, (p,) each, of Gaussian priors of the coordinates."""
        of_size = np.asarray([1.0 / c.std for c in self.coordinates])
        uniform = (of_size == 0.0) & np.isinf(self.normal_std) & (self.priors == "all")
        return np.where(uniform, 0.5, 0.0), np.where(uniform, np.sqrt(UNIFORM_PRECISION), of_size)

    def deviation(self, x: Floats) -> Floats:
        r"""Deviations z (..., t + p) of unit variance from tests and priors, at x (..., p).

        .. math:: z_i = (x_i - m_i) / s_i + \theta_i(x_i) / \sigma_i

        for each coordinate, of which one part at most is not zero.
        """
        middle, root = self._gaussian
        own = root * (x - middle) + values_at(self.coordinates, x) / self.normal_std
        return np.concatenate([self.soil_tests.deviation(x), own], axis=-1)

    def rates(self, x: Floats) -> Floats:
        """Derivatives (t + p, p) of the deviations at coordinates x (p,)."""
        own = self._gaussian[1] + rates_at(self.coordinates, x) / self.normal_std
        return np.vstack([self.soil_tests.rates(x), np.diag(own)])

    @cached_property
    def lower(self) -> Floats:
        """Lower bounds of the coordinates, (p,)."""
        return np.asarray([c.lower for c in self.coordinates])

    @cached_property
    def upper(self) -> Floats:
        """Upper bounds of the coordinates, (p,)."""
        return np.asarray([c.upper for c in self.coordinates])

    def predict(self, x: Floats, start: SinkageEstimate | None = None) -> Floats:
        """Predictions (sets, m) at x (sets, p), searched from an estimate of the sinkage."""
        return predict(self.case, self.coordinates, x, self.readings, start)

    def residual(self, prediction: Floats) -> Floats:
        """Residuals (..., m) in the units of the readings."""
        residual = self.readings.measured - prediction
        return np.where(np.isfinite(residual), residual, NO_EQUILIBRIUM * self.readings.std)

    def whitened(self, prediction: Floats) -> Floats:
        """Residuals (..., m) of unit covariance."""
        residual = self.residual(prediction)
        if residual.ndim == 1:
            return np.asarray(self.whiten @ residual)
        flat = residual.reshape(-1, residual.shape[-1])
        white = np.asarray((self.whiten @ flat.T).T)
        return white.reshape(*residual.shape[:-1], white.shape[-1])

    def objective(self, residual: Floats, x: Floats) -> Floats:
        """What is minimised, at whitened residuals (..., m) and coordinates (..., p)."""
        of_terms = (self.deviation(x) ** 2).sum(axis=-1)
        return np.asarray((residual**2).sum(axis=-1) + of_terms)

    def at(self, x: Floats, linearisation: Linearisation) -> Solution:
        """The problem at x (p,), from a linearisation there."""
        residual = self.whitened(linearisation.prediction)
        jacobian = np.asarray(self.whiten @ np.nan_to_num(linearisation.jacobian))
        objective = float(self.objective(residual, x))
        return Solution(self, x, linearisation, residual, jacobian, objective)

    def linearised(self, x: Floats, near: Linearisation | None = None) -> Solution:
        """The problem at x (p,), found from a linearisation `near` it where there is one."""
        return self.at(x, linearise(self.case, self.coordinates, x, self.readings, near))


@dataclass(frozen=True)
class Solution:
    """A point of a least-squares problem: an optimum, or a trial on the way to it.

    `objective` is that of the problem. `converged` says that a descent ended here by its
    tolerances, and not at its limit of iterations.
    """

    problem: LeastSquaresProblem
    x: Floats  # (p,)
    linearisation: Linearisation
    residual: Floats  # (m,) whitened
    jacobian: Floats  # (m, p) of the readings, whitened
    objective: float
    converged: bool = False

    @property
    def case(self) -> Case:
        """The case that was fitted, with the parameters from before."""
        return self.problem.case

    @property
    def coordinates(self) -> Sequence[Coordinate]:
        """The coordinates of the fit."""
        return self.problem.coordinates

    @property
    def effects(self) -> list[str]:
        """The effects whose parameters were fitted, each once."""
        return list(dict.fromkeys(c.effect for c in self.coordinates if c.effect))

    @property
    def measured(self) -> Floats:
        """The measured values, (m,)."""
        return self.problem.readings.measured

    @property
    def prediction(self) -> Floats:
        """Predictions of the readings, (m,)."""
        return self.linearisation.prediction

    @property
    def derivatives(self) -> Floats:
        """Derivatives of the predictions by the coordinates, (m, p); zero where unknown."""
        return np.nan_to_num(self.linearisation.jacobian)

    @property
    def cost(self) -> float:
        """Sum of the squared whitened residuals."""
        return float(self.residual @ self.residual)

    @property
    def precision(self) -> Floats:
        """Precision of the normal density of each coordinate about zero, (p,)."""
        return np.asarray([c.std**-2 for c in self.coordinates])

    @property
    def soil_tests(self) -> SoilTestTerms:
        """Deviations from tests of the soil."""
        return self.problem.soil_tests

    @property
    def information(self) -> Floats:
        """Linearised information on the coordinates by readings, soil tests and priors, (p, p).

        A soil coordinate is uniform a priori; its precision enters as that of a Gaussian.
        """
        uniform = [
            UNIFORM_PRECISION if np.isinf(c.std) and not c.of_candidate else 0.0
            for c in self.coordinates
        ]
        jacobian = np.vstack([self.jacobian, self.soil_tests.rates(self.x)])
        return np.asarray(jacobian.T @ jacobian + np.diag(self.precision + np.asarray(uniform)))

    @property
    def covariance(self) -> Floats:
        """Linearised posterior covariance of the coordinates, (p, p)."""
        return np.asarray(np.linalg.pinv(self.information))

    def whitened_by(self, whiten: Whitening | Floats) -> Solution:
        """The same point with residuals and Jacobian whitened by another matrix (m, m)."""
        return replace(
            self,
            problem=replace(self.problem, whiten=whiten),
            residual=np.asarray(whiten @ (self.measured - self.prediction)),
            jacobian=np.asarray(whiten @ self.derivatives),
        )

    def values(self) -> dict[str, float]:
        """Parameters at this point, by path."""
        values = values_at(self.coordinates, self.x)
        return dict(zip((c.path for c in self.coordinates), map(float, values), strict=True))

    def stds(self) -> dict[str, float]:
        """Standard deviations of the parameters, by path."""
        std = np.sqrt(np.diag(self.covariance)) * np.abs(rates_at(self.coordinates, self.x))
        return dict(zip((c.path for c in self.coordinates), map(float, std), strict=True))

    def start_values(self) -> dict[str, float]:
        """Coordinates by path, for another fit to start from."""
        return {c.path: float(x) for c, x in zip(self.coordinates, self.x, strict=True)}

    def fitted(self) -> Case:
        """The case with the parameters of this point."""
        return self.case.with_values(self.values())
