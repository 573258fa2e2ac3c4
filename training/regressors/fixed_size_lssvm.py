"""Fixed-size least squares support vector regression: its size is independent of the data's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from training.regressors.gaussian_head import GaussianHead, validate_training_data
from training.regressors.kernel_expansion import KernelExpansion
from training.regressors.rbf_kernel import log_squared_residuals, median_distance, rbf
from training.regressors.renyi_subset import select_by_renyi_entropy
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]

#: Searched by leave-one-out unless fixed: widths in median distances between rows, and gammas.
WIDTHS = (0.5, 1.0, 1.5, 2.0, 3.0)
GAMMAS = tuple(10.0**k for k in range(-6, 9))
#: Rows on which width and gamma are selected, and rows whose features are computed at a time.
SEARCH_ROWS = 8000
CHUNK = 4096
#: Eigenvalues of the centres' kernel matrix below this share of the largest are rounding errors.
RANK_TOLERANCE = 1e-11


@dataclass(frozen=True)
class RidgeEigensystem:
    """Ridge regression with an unpenalised bias, decomposed so that any gamma is cheap."""

    mean: Floats  # (m,) of the features
    values: Floats  # (m,) eigenvalues of the centred Gram matrix
    vectors: Floats  # (m, m)

    @staticmethod
    def of(features: Floats) -> RidgeEigensystem:
        """Decompose the centred Gram matrix of features (n, m)."""
        mean = features.mean(axis=0)
        centred = features - mean
        return RidgeEigensystem(mean, *np.linalg.eigh(centred.T @ centred))

    def solve(self, features: Floats, y: Floats, gamma: float) -> tuple[Floats, Floats]:
        """Weights (m, q) and bias (q,)."""
        y_mean = y.mean(axis=0)
        projected = self.vectors.T @ ((features - self.mean).T @ (y - y_mean))
        weights = self.vectors @ (projected / (self.values + 1.0 / gamma)[:, None])
        return weights, y_mean - self.mean @ weights

    def leave_one_out(self, features: Floats, y: Floats, gamma: float) -> Floats:
        """Residuals (n, q) of each row when it is left out (PRESS), in closed form."""
        weights, bias = self.solve(features, y, gamma)
        projected = (features - self.mean) @ self.vectors
        leverage = 1.0 / len(y) + (projected**2) @ (1.0 / (self.values + 1.0 / gamma))
        return np.asarray((y - features @ weights - bias) / (1.0 - leverage)[:, None])


class FixedSizeLSSVM(KernelExpansion):
    """LS-SVM in the primal, on Nystrom features of a subset of the rows with large Renyi entropy.

    Parameters
    ----------
    centres : int
        Size of the subset, and of the exported model.
    gamma, width : float or None
        As for `LSSVM`; selected by closed-form leave-one-out if None.
    random_state : int
        Seed of the selection of centres.

    Notes
    -----
    More centres reduce the error only while the function varies over less than their distance; the
    inverse problem from a single reading does not.

    References
    ----------
    Suykens et al., Least Squares Support Vector Machines, 2002, chapter 6; Williams and Seeger,
    NIPS 13, 2001 (Nystrom).
    """

    type_name: ClassVar[str] = "fixed-size-lssvm"

    def __init__(
        self,
        centres: int = 150,
        gamma: float | None = None,
        width: float | None = None,
        random_state: int = 0,
    ) -> None:
        self.centres = centres
        self.gamma = gamma
        self.width = width
        self.random_state = random_state

    def fit(self, X: Any, y: Any) -> FixedSizeLSSVM:
        """Fit rows X (n, d) to y (n,) or (n, q)."""
        X, Y, one_output = validate_training_data(self, X, y)
        self.x_scaling_, self.y_scaling_ = Standardisation.of(X), Standardisation.of(Y)
        x, z = self.x_scaling_.apply(X), self.y_scaling_.apply(Y)
        with threadpool_limits(1):
            self._select_hyperparameters(x, z)
            features = self._features(x)
            ridge = RidgeEigensystem.of(features)
            weights, self.bias_ = ridge.solve(features, z, self.gamma_)
            self.loo_residual_ = ridge.leave_one_out(features, z, self.gamma_)
            logs = log_squared_residuals(self.loo_residual_)
            errors = [np.mean(ridge.leave_one_out(features, logs, g) ** 2) for g in GAMMAS]
            gamma = GAMMAS[int(np.argmin(errors))]
            log_weights, self.log_variance_bias_ = ridge.solve(features, logs, gamma)
        logs = features @ log_weights + self.log_variance_bias_
        self.head_ = GaussianHead.of(self.y_scaling_, logs, one_output)
        self.alpha_ = self.projection_ @ weights
        self.log_variance_alpha_ = self.projection_ @ log_weights
        return self

    def _select_hyperparameters(self, x: Floats, z: Floats) -> None:
        """Centres, width and gamma, by leave-one-out on a sample of the rows."""
        median = median_distance(x)
        widths = [w * median for w in WIDTHS] if self.width is None else [float(self.width)]
        gammas = GAMMAS if self.gamma is None else (float(self.gamma),)
        sample = np.random.default_rng(self.random_state).permutation(len(x))[:SEARCH_ROWS]
        least, self.search_ = np.inf, []
        for width in widths:
            centres = x[select_by_renyi_entropy(x, self.centres, width, self.random_state)]
            projection = _nystrom_projection(centres, width)
            features = rbf(x[sample], centres, width) @ projection
            ridge = RidgeEigensystem.of(features)
            errors = np.asarray(
                [np.mean(ridge.leave_one_out(features, z[sample], g) ** 2) for g in gammas]
            )
            self.search_.append((width, np.asarray(gammas), errors))
            if errors.min() < least:
                least, self.width_ = errors.min(), width
                self.gamma_ = gammas[int(np.argmin(errors))]
                self.centres_, self.projection_ = centres, projection

    def _features(self, x: Floats) -> Floats:
        """Nystrom features (n, k) of standardised inputs (n, d)."""
        parts = [
            rbf(x[i : i + CHUNK], self.centres_, self.width_) @ self.projection_
            for i in range(0, len(x), CHUNK)
        ]
        return np.vstack(parts)


def _nystrom_projection(centres: Floats, width: float) -> Floats:
    """Projection (m, k) from kernel values against the centres to Nystrom features."""
    values, vectors = np.linalg.eigh(rbf(centres, centres, width))
    significant = values > RANK_TOLERANCE * values[-1]
    return np.asarray(vectors[:, significant] / np.sqrt(values[significant]))
