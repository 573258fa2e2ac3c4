"""What readings tell of others: prediction of those left out, each one from all others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.inference.evidence import LinearisedFit
from soilml.inference.gaussian_terms import Hyperparameters


@dataclass(frozen=True, eq=False)
class Conditional:
    """Weights of columns and changes of coordinates, given readings: mean and covariance.

    columns (m, k): What one standard deviation a priori of each changes, scatter apart.
    mean (k,), covariance (k, k): Of these.
    scatter (m, s): What one standard deviation of scatter of its own run changes of each reading.
    run (m,): Run of each reading.
    weights (R, s), root (R, s, s), back (R, s, k): Of scatter; see `Eliminated`.
    noise (m,): Standard deviation of the noise.
    """

    columns: Floats
    mean: Floats
    covariance: Floats
    scatter: Floats
    run: Integers
    weights: Floats
    root: Floats
    back: Floats
    noise: Floats

    @property
    def variance(self) -> Floats:
        """Variance (m,) of a reading that is left out."""
        return np.asarray(self.noise**2 + self.spread(self.scatter, self.columns))

    @property
    def expected(self) -> Floats:
        """Expected residual (m,) of a reading that is left out."""
        expected = self.columns @ self.mean
        if len(self.weights):
            expected = expected + (self.scatter * self.weights[self.run]).sum(axis=1)
        return np.asarray(expected)

    def spread(self, scatter: Floats, columns: Floats) -> Floats:
        """Variance (m,) by weights and coordinates of combinations (m, s) and (m, k) of them.

        The scatter of each combination is that of the run of the reading.
        """
        own = np.zeros_like(scatter)
        if len(self.root):
            own = np.einsum("ijk,ik->ij", self.root[self.run], scatter)
            columns = columns - np.einsum("ij,ijk->ik", scatter, self.back[self.run])
        rest = columns @ np.linalg.cholesky(self.covariance)
        return np.asarray((own**2).sum(axis=1) + (rest**2).sum(axis=1))


def conditional(model: LinearisedFit, at: Hyperparameters) -> Conditional:
    r"""What the readings that are kept tell of weights and coordinates, to first order.

    .. math:: r_i \sim N(B_i \hat\beta,\; \sigma_i^2 + B_i \Sigma B_i^T), \quad
        \Sigma = M^{-1}, \quad \hat\beta = \Sigma b

    for a reading that is left out; noise that is correlated with that of others counts as
    independent there.
    """
    terms = model.terms
    used, _, found, scale, matrix, b = model.normal_equations(at)
    covariance = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    mean = covariance @ b
    return Conditional(
        columns=np.column_stack([terms.columns[:, used], model.jacobian]) * scale,
        mean=mean,
        covariance=covariance,
        scatter=terms.scatter_change * found.std,
        run=terms.run,
        weights=found.weights(np.append(-scale * mean, 1.0)),
        root=found.root,
        back=found.back[:, :, :-1] * scale,
        noise=terms.noise_std(at),
    )


def leave_one_out(model: LinearisedFit, at: Hyperparameters) -> tuple[Floats, Floats]:
    r"""Error (m,) of the prediction of each reading from all others, and its variance.

    .. math:: e_i = [V^{-1} r]_i / [V^{-1}]_{ii}, \quad v_i = 1 / [V^{-1}]_{ii}

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 5.12.
    """
    found = conditional(model, at)
    noise = model.terms.whitened(at.autocorrelation, ~model.outliers).noise
    scale = model.terms.noise_scale(at)[model.terms.readings.channel]
    left = model.residual - found.expected
    every = np.column_stack([left, found.scatter, found.columns]) / scale[:, None]
    if noise.ndim == 1:
        back = noise[:, None] ** 2 * every
        diagonal = noise**2
    else:
        back = noise.T @ (noise @ every)
        diagonal = np.asarray((noise.multiply(noise)).sum(axis=0))
    back = back / scale[:, None]
    s = found.scatter.shape[1]
    diagonal = diagonal / scale**2 - found.spread(back[:, 1 : 1 + s], back[:, 1 + s :])
    kept = ~model.outliers
    variance = np.where(kept, 1.0 / np.maximum(diagonal, 1e-300), found.variance)
    return np.where(kept, back[:, 0] * variance, left), variance
