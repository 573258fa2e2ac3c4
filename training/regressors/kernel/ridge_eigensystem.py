"""Ridge regression with an unpenalised bias from streamed moments, for any gamma."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RidgeEigensystem:
    """The centred Gram matrix of features, decomposed so that any gamma is cheap.

    Features (n, m) are needed in parts only: its size does not depend on the number of rows.
    """

    count: int  # n
    mean: Floats  # (m,) of the features
    values: Floats  # (m,) eigenvalues of the centred Gram matrix
    vectors: Floats  # (m, m)

    @staticmethod
    def of_moments(count: int, origin: Floats, total: Floats, gram: Floats) -> RidgeEigensystem:
        """From sums (m,) and products (m, m) of features less an origin (m,) near their mean."""
        centred = gram - np.outer(total, total) / count
        return RidgeEigensystem(count, origin + total / count, *np.linalg.eigh(centred))

    @staticmethod
    def of(features: Floats) -> RidgeEigensystem:
        """Of features (n, m) in memory."""
        mean = features.mean(axis=0)
        centred = features - mean
        return RidgeEigensystem(len(features), mean, *np.linalg.eigh(centred.T @ centred))

    def project(self, features: Floats) -> Floats:
        """Centred features (n, m) along the eigenvectors."""
        return np.asarray((features - self.mean) @ self.vectors)

    def solve(self, moment: Floats, gamma: float) -> Floats:
        """Weights (m, q) along the eigenvectors, from moments (m, q) of centred features and y."""
        return np.asarray((self.vectors.T @ moment) * self.shrinkage(gamma)[:, None])

    def shrinkage(self, gamma: float) -> Floats:
        """Eigenvalues (m,) of the inverse of the penalised Gram matrix."""
        return np.asarray(1.0 / (self.values + 1.0 / gamma))

    def leverage(self, projected: Floats, gamma: float) -> Floats:
        """Derivative (n,) of each row's prediction by its own y, from projected features (n, m)."""
        return np.asarray(1.0 / self.count + (projected**2) @ self.shrinkage(gamma))

    def leave_one_out(self, projected: Floats, y: Floats, weights: Floats, gamma: float) -> Floats:
        """Residuals (n, q) of centred y when each row is left out (PRESS), in closed form."""
        residual = y - projected @ weights
        return np.asarray(residual / (1.0 - self.leverage(projected, gamma))[:, None])
