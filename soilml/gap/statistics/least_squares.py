"""Generalised least squares on the full model, bounded, with priors on some coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.gap.data.observations import Cells
from soilml.gap.statistics.coordinates import Axis, linearised, predicted

Floats = NDArray[np.float64]

ROUNDS = 25
#: Whitened residual of a reading for which a trial has no equilibrium.
NO_ANSWER = 1e2
#: A descent ends when a step lowers the objective by less than this, or by less than this share.
ENOUGH, SHARE = 0.01, 2e-3


@dataclass(frozen=True)
class GapFit:
    """An optimum: coordinates, whitened residuals and derivatives there, and the objective.

    `cost` is the sum of squared whitened residuals and of squared coordinates over their prior
    spread; `converged` says whether the descent came to rest.
    """

    case: Case
    axes: tuple[Axis, ...]
    x: Floats  # (p,)
    prediction: Floats  # (m,)
    residual: Floats  # (m,) whitened
    slope: Floats  # (m, p) whitened
    cost: float
    converged: bool

    @property
    def precision(self) -> Floats:
        """Gaussian prior's precision of each coordinate, (p,)."""
        return np.asarray([axis.std**-2 for axis in self.axes])

    @property
    def covariance(self) -> Floats:
        """Covariance of the coordinates, linearised, (p, p)."""
        flat = np.asarray(
            [12.0 if np.isinf(a.std) and "." not in a.path else 0.0 for a in self.axes]
        )
        return np.asarray(
            np.linalg.pinv(self.slope.T @ self.slope + np.diag(self.precision + flat))
        )

    def values(self) -> dict[str, float]:
        """The parameters at the optimum, by path."""
        return {
            axis.path: float(axis.value(self.x[i : i + 1])[0]) for i, axis in enumerate(self.axes)
        }

    def stds(self) -> dict[str, float]:
        """Standard deviations of the parameters, by path."""
        spread = np.sqrt(np.diag(self.covariance))
        return {
            axis.path: float(spread[i] * abs(axis.rate(float(self.x[i]))))
            for i, axis in enumerate(self.axes)
        }

    def fitted(self) -> Case:
        """The case with the parameters of the optimum."""
        return self.case.with_values(self.values())


def descend(
    case: Case, axes: Sequence[Axis], cells: Cells, whiten: Floats, start: Floats
) -> GapFit:
    r"""Levenberg-Marquardt with bounds, from one start.

    .. math:: \min_x \|L^{-1} (y - f(x))\|^2 + \sum_k (x_k / \sigma_k)^2

    `whiten` (m, m) is the inverse of the covariance's Cholesky factor L. References: Nocedal and
    Wright, Numerical Optimization, 2006, section 10.3.
    """
    lower = np.asarray([axis.lower for axis in axes])
    upper = np.asarray([axis.upper for axis in axes])
    weight = np.asarray([1.0 / axis.std for axis in axes])

    def objective(off: Floats, x: Floats) -> Floats:
        return np.asarray((off**2).sum(axis=-1) + ((x * weight) ** 2).sum(axis=-1))

    def residuals(y: Floats) -> Floats:
        white = (cells.reading - y) @ whiten.T
        return np.where(np.isfinite(white), white, NO_ANSWER)

    x = np.clip(start, lower, upper)
    y, slope = linearised(case, axes, x, cells)
    off, steep = residuals(y), whiten @ np.nan_to_num(slope)
    cost, damping, converged = float(objective(off, x)), 1e-3, False
    for _ in range(ROUNDS):
        gradient = steep.T @ off - weight**2 * x
        held = ((x <= lower) & (gradient < 0)) | ((x >= upper) & (gradient > 0))
        if held.all():
            converged = True
            break
        free = ~held
        normal = steep[:, free].T @ steep[:, free] + np.diag(weight[free] ** 2)
        scale = np.diag(np.diag(normal) + 1e-9)
        dampings = damping * np.asarray([0.01, 1.0, 100.0])
        trials = np.tile(x, (len(dampings), 1))
        for i, d in enumerate(dampings):
            trials[i, free] += np.linalg.solve(normal + d * scale, gradient[free])
        trials = np.clip(trials, lower, upper)
        costs = objective(residuals(predicted(case, axes, trials, cells)), trials)
        best = int(np.argmin(costs))
        gained = cost - float(costs[best])
        if gained <= 0.0:
            # a step of no length that does not help is an optimum; a long one asks for more damping
            converged = float(np.abs(trials[-1] - x).max()) < 1e-3
            damping *= 1e3
            if converged or damping > 1e9:
                break
            continue
        x, cost, damping = trials[best], float(costs[best]), max(float(dampings[best]), 1e-9)
        y, slope = linearised(case, axes, x, cells)
        off, steep = residuals(y), whiten @ np.nan_to_num(slope)
        if gained < max(ENOUGH, SHARE * (cost - len(cells))):
            converged = True
            break
    return GapFit(case, tuple(axes), x, y, off, steep, cost, converged)
