"""What readings tell of others: prediction of those left out, each one from all others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.inference.evidence import LinearisedFit
from soilml.inference.gaussian_terms import Hyperparameters


@dataclass(frozen=True, eq=False)
class Conditional:
    """Weights of columns and changes of coordinates, given readings: mean and covariance.

    columns (m, k): What one standard deviation a priori of each changes.
    noise (m,): Standard deviation of the noise.
    """

    columns: Floats
    mean: Floats
    covariance: Floats
    noise: Floats

    @property
    def variance(self) -> Floats:
        """Variance (m,) of a reading that is left out."""
        spread = np.einsum("ij,jk,ik->i", self.columns, self.covariance, self.columns)
        return np.asarray(self.noise**2 + spread)

    @property
    def expected(self) -> Floats:
        """Expected residual (m,) of a reading that is left out."""
        return np.asarray(self.columns @ self.mean)


def conditional(model: LinearisedFit, at: Hyperparameters) -> Conditional:
    r"""What the readings that are kept tell of weights and coordinates, to first order.

    .. math:: r_i \sim N(B_i \hat\beta,\; \sigma_i^2 + B_i \Sigma B_i^T), \quad
        \Sigma = M^{-1}, \quad \hat\beta = \Sigma b

    for a reading that is left out; noise that is correlated with that of others counts as
    independent there.
    """
    terms, p = model.terms, len(model.x)
    gram, _, _ = model.products(at.autocorrelation)
    variance, q = terms.variance(at), gram.shape[1] - p - 1
    used = np.flatnonzero(variance > 0.0)
    take = np.concatenate([used, np.arange(q, q + p + 1)])
    weight = np.exp(-2.0 * at.log[terms.groups :])
    total = np.einsum("c,cij->ij", weight, gram[:, take[:, None], take])
    scale = np.concatenate([np.sqrt(variance[used]), np.ones(p)])
    matrix = scale[:, None] * total[:-1, :-1] * scale
    k = len(used)
    matrix[np.arange(k), np.arange(k)] += 1.0
    matrix[k:, k:] += np.diag(model.precision) + model.information
    b = scale * total[:-1, -1]
    b[k:] -= model.pull
    covariance = np.linalg.inv(matrix)
    columns = np.column_stack([terms.columns[:, used], model.jacobian]) * scale
    return Conditional(columns, covariance @ b, covariance, terms.noise_std(at))


def leave_one_out(model: LinearisedFit, at: Hyperparameters) -> tuple[Floats, Floats]:
    r"""Error (m,) of the prediction of each reading from all others, and its variance.

    .. math:: e_i = [V^{-1} r]_i / [V^{-1}]_{ii}, \quad v_i = 1 / [V^{-1}]_{ii}

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 5.12.
    """
    found = conditional(model, at)
    noise = model.terms.whitened(at.autocorrelation, ~model.outliers).noise
    scale = model.terms.noise_scale(at)[model.terms.readings.channel]
    white = noise[:, None] * found.columns if noise.ndim == 1 else noise @ found.columns
    white = white / scale[:, None]
    left = model.residual - found.columns @ found.mean
    own = noise * left if noise.ndim == 1 else noise @ left
    own = own / scale
    back = noise * own if noise.ndim == 1 else noise.T @ own
    root = np.linalg.cholesky(found.covariance)
    inner = noise[:, None] * white if noise.ndim == 1 else noise.T @ white
    diagonal = noise**2 if noise.ndim == 1 else np.asarray((noise.multiply(noise)).sum(axis=0))
    weighted = back / scale
    diagonal = diagonal / scale**2 - (((inner / scale[:, None]) @ root) ** 2).sum(axis=1)
    kept = ~model.outliers
    variance = np.where(kept, 1.0 / np.maximum(diagonal, 1e-300), found.variance)
    return np.where(kept, weighted * variance, left), variance
