"""Generalised least squares on the full model, bounded, with priors on some coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.gap.data.stacked_readings import StackedReadings
from soilml.gap.statistics.coordinates import (
    FitCoordinate,
    SoilCoordinate,
    linearise,
    predict_readings,
)

Floats = NDArray[np.float64]

#: Iterations after which a descent is abandoned as not converged; typical fits need five to ten.
MAX_ITERATIONS = 25
#: Whitened residual assigned to a reading where a trial has no equilibrium: large enough that the
#: trial is rejected, finite so that trials can still be compared.
INFEASIBLE_RESIDUAL = 1e2
#: A descent has converged when a step lowers the objective by less than `ENOUGH` (far below the
#: thresholds on differences of the objective, which start at 9) or by less than the fraction
#: `SHARE` of its excess over the number of readings (while the model is far from the data).
ENOUGH, SHARE = 0.01, 2e-3
#: Levenberg-Marquardt damping: the first value, the factors that are tried in each iteration, the
#: factor after an iteration without improvement, and the bounds.
FIRST_DAMPING, DAMPING_FACTORS, DAMPING_INCREASE = 1e-3, (0.01, 1.0, 100.0), 1e3
MIN_DAMPING, MAX_DAMPING = 1e-9, 1e9
#: Precision of a fraction of the prior: a uniform distribution from 0 to 1 has variance 1/12.
UNIFORM_PRECISION = 12.0


@dataclass(frozen=True)
class GapFit:
    """An optimum of generalised least squares: coordinates, residuals, Jacobian and objective.

    `objective` is the sum of squared whitened residuals plus the sum of squared coordinates over
    their prior variances; `converged` is false where the iteration limit was reached.
    """

    case: Case
    coordinates: tuple[FitCoordinate, ...]
    x: Floats  # (p,)
    prediction: Floats  # (m,)
    residual: Floats  # (m,) whitened
    jacobian: Floats  # (m, p) whitened
    objective: float
    converged: bool
    reading: Floats  # (m,)
    derivatives: Floats  # (m, p) Jacobian in the readings' unit

    def whitened_by(self, whiten: Floats) -> GapFit:
        """The same optimum with residuals and Jacobian whitened by another matrix (m, m)."""
        residual = whiten @ (self.reading - self.prediction)
        return replace(self, residual=residual, jacobian=whiten @ self.derivatives)

    @property
    def precision(self) -> Floats:
        """Precision of the Gaussian prior of each coordinate, (p,)."""
        return np.asarray([c.std**-2 for c in self.coordinates])

    @property
    def covariance(self) -> Floats:
        """Linearised posterior covariance of the coordinates, (p, p).

        A soil coordinate is uniform a priori; its precision enters as that of a Gaussian.
        """
        uniform = np.asarray(
            [
                UNIFORM_PRECISION if np.isinf(c.std) and isinstance(c, SoilCoordinate) else 0.0
                for c in self.coordinates
            ]
        )
        return np.asarray(
            np.linalg.pinv(self.jacobian.T @ self.jacobian + np.diag(self.precision + uniform))
        )

    def values(self) -> dict[str, float]:
        """Parameters at the optimum, by path."""
        return {
            c.path: float(c.value(self.x[i : i + 1])[0]) for i, c in enumerate(self.coordinates)
        }

    def stds(self) -> dict[str, float]:
        """Standard deviations of the parameters, by path."""
        std = np.sqrt(np.diag(self.covariance))
        return {
            c.path: float(std[i] * abs(c.rate(float(self.x[i]))))
            for i, c in enumerate(self.coordinates)
        }

    def start_values(self) -> dict[str, float]:
        """Coordinates by path, for another fit to start from."""
        return {c.path: float(x) for c, x in zip(self.coordinates, self.x, strict=True)}

    def fitted(self) -> Case:
        """The case with the parameters of the optimum."""
        return self.case.with_values(self.values())


def levenberg_marquardt(
    case: Case,
    coordinates: Sequence[FitCoordinate],
    readings: StackedReadings,
    whiten: Floats,
    start: Floats,
) -> GapFit:
    r"""Bounded Levenberg-Marquardt descent from one start.

    .. math:: \min_x \|L^{-1} (y - f(x))\|^2 + \sum_k (x_k / \sigma_k)^2

    Parameters
    ----------
    whiten : array (m, m)
        Inverse of the Cholesky factor L of the covariance of the readings.
    start : array (p,)
        First coordinates; clipped to the bounds.

    References
    ----------
    Nocedal and Wright, Numerical Optimization, 2006, section 10.3.
    """
    lower = np.asarray([c.lower for c in coordinates])
    upper = np.asarray([c.upper for c in coordinates])
    weight = np.asarray([1.0 / c.std for c in coordinates])

    def objective_of(residual: Floats, x: Floats) -> Floats:
        return np.asarray((residual**2).sum(axis=-1) + ((x * weight) ** 2).sum(axis=-1))

    def whitened_residual(y: Floats) -> Floats:
        white = (readings.reading - y) @ whiten.T
        return np.where(np.isfinite(white), white, INFEASIBLE_RESIDUAL)

    x = np.clip(start, lower, upper)
    y, derivatives = _finite_derivatives(case, coordinates, x, readings)
    residual, jacobian = whitened_residual(y), whiten @ derivatives
    objective, damping, converged = float(objective_of(residual, x)), FIRST_DAMPING, False
    for _ in range(MAX_ITERATIONS):
        descent = jacobian.T @ residual - weight**2 * x  # half the negative gradient
        at_bound = ((x <= lower) & (descent < 0)) | ((x >= upper) & (descent > 0))
        if at_bound.all():
            converged = True
            break
        free = ~at_bound
        normal = jacobian[:, free].T @ jacobian[:, free] + np.diag(weight[free] ** 2)
        scale = np.diag(np.diag(normal) + 1e-9)
        dampings = damping * np.asarray(DAMPING_FACTORS)
        trials = np.tile(x, (len(dampings), 1))
        for i, d in enumerate(dampings):
            trials[i, free] += np.linalg.solve(normal + d * scale, descent[free])
        trials = np.clip(trials, lower, upper)
        predictions = predict_readings(case, coordinates, trials, readings)
        objectives = objective_of(whitened_residual(predictions), trials)
        best = int(np.argmin(objectives))
        improvement = objective - float(objectives[best])
        if improvement <= 0.0:
            # if the most damped, shortest step is negligible this is an optimum; else damp more
            converged = float(np.abs(trials[-1] - x).max()) < 1e-3
            damping *= DAMPING_INCREASE
            if converged or damping > MAX_DAMPING:
                break
            continue
        x, objective = trials[best], float(objectives[best])
        damping = max(float(dampings[best]), MIN_DAMPING)
        y, derivatives = _finite_derivatives(case, coordinates, x, readings)
        residual, jacobian = whitened_residual(y), whiten @ derivatives
        if improvement < max(ENOUGH, SHARE * (objective - len(readings))):
            converged = True
            break
    return GapFit(
        case,
        tuple(coordinates),
        x,
        y,
        residual,
        jacobian,
        objective,
        converged,
        readings.reading,
        derivatives,
    )


def _finite_derivatives(
    case: Case, coordinates: Sequence[FitCoordinate], x: Floats, readings: StackedReadings
) -> tuple[Floats, Floats]:
    """Predictions and Jacobian; derivatives without an equilibrium are zero."""
    y, derivatives = linearise(case, coordinates, x, readings)
    return y, np.nan_to_num(derivatives)
