"""The fixed-size least squares support vector machine: small, whatever the data's size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from training.regressors.gaussian_head import GaussianHead, checked
from training.regressors.kernel_expansion import KernelExpansion
from training.regressors.rbf_kernel import log_squares, median_distance, rbf
from training.regressors.renyi_subset import entropy_selected
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]

WIDTHS = (0.5, 1.0, 1.5, 2.0, 3.0)
GAMMAS = tuple(10.0**k for k in range(-6, 9))
#: Rows on which widths and gammas are chosen, and rows turned into features at a time.
CHOOSING_ROWS = 8000
CHUNK = 4096
#: Directions of the centres' kernel matrix below this share of the largest carry only rounding.
RANK = 1e-11


@dataclass(frozen=True)
class Primal:
    """Ridge regression on features with a free bias, ready for any gamma."""

    mean: Floats  # (m,) of the features
    values: Floats  # (m,) eigenvalues of the centred Gram matrix
    vectors: Floats  # (m, m)

    @staticmethod
    def of(features: Floats) -> Primal:
        """One factorisation of features (n, m)."""
        mean = features.mean(axis=0)
        centred = features - mean
        return Primal(mean, *np.linalg.eigh(centred.T @ centred))

    def solved(self, features: Floats, y: Floats, gamma: float) -> tuple[Floats, Floats]:
        """Weights (m, q) and bias (q,)."""
        centre = y.mean(axis=0)
        along = self.vectors.T @ ((features - self.mean).T @ (y - centre))
        weights = self.vectors @ (along / (self.values + 1.0 / gamma)[:, None])
        return weights, centre - self.mean @ weights

    def leave_one_out(self, features: Floats, y: Floats, gamma: float) -> Floats:
        """Residuals (n, q) that each row would have if it were left out (PRESS), closed form."""
        weights, bias = self.solved(features, y, gamma)
        along = (features - self.mean) @ self.vectors
        leverage = 1.0 / len(y) + (along**2) @ (1.0 / (self.values + 1.0 / gamma))
        return np.asarray((y - features @ weights - bias) / (1.0 - leverage)[:, None])


class FixedSizeLSSVM(KernelExpansion):
    """LS-SVM in the primal, on Nystrom features of an entropy-selected subset of the rows.

    Parameters
    ----------
    centres : int
        Size of the subset, and of the exported model.
    gamma, width : float or None
        As for `LSSVM`; chosen by closed-form leave-one-out if None.
    random_state : int
        Seed of the selection.

    References: Suykens et al., Least Squares Support Vector Machines, 2002, chapter 6; Williams
    and Seeger, NIPS 13, 2001 (Nystrom). Twice as many centres help while the function to learn is
    finer than their distance; the inverse problem from one triple is not.
    """

    kind: ClassVar[str] = "fixed-size-lssvm"

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
        X, Y, one_output = checked(self, X, y)
        self.x_scaling_, self.y_scaling_ = Standardisation.of(X), Standardisation.of(Y)
        x, z = self.x_scaling_.apply(X), self.y_scaling_.apply(Y)
        with threadpool_limits(1):
            self._choose(x, z)
            features = self._features(x)
            primal = Primal.of(features)
            weights, self.bias_ = primal.solved(features, z, self.gamma_)
            self.loo_residual_ = primal.leave_one_out(features, z, self.gamma_)
            logs = log_squares(self.loo_residual_)
            errors = [np.mean(primal.leave_one_out(features, logs, g) ** 2) for g in GAMMAS]
            spread, self.spread_bias_ = primal.solved(
                features, logs, GAMMAS[int(np.argmin(errors))]
            )
        logs = features @ spread + self.spread_bias_
        self.head_ = GaussianHead.of(self.y_scaling_, logs, one_output)
        self.alpha_ = self.projection_ @ weights
        self.spread_alpha_ = self.projection_ @ spread
        return self

    def _choose(self, x: Floats, z: Floats) -> None:
        """Centres, width and gamma, by leave-one-out on some of the rows."""
        unit = median_distance(x)
        widths = [w * unit for w in WIDTHS] if self.width is None else [float(self.width)]
        gammas = GAMMAS if self.gamma is None else (float(self.gamma),)
        some = np.random.default_rng(self.random_state).permutation(len(x))[:CHOOSING_ROWS]
        least, self.search_ = np.inf, []
        for width in widths:
            centres = x[entropy_selected(x, self.centres, width, self.random_state)]
            projection = _whitening(centres, width)
            features = rbf(x[some], centres, width) @ projection
            primal = Primal.of(features)
            errors = np.asarray(
                [np.mean(primal.leave_one_out(features, z[some], g) ** 2) for g in gammas]
            )
            self.search_.append((width, np.asarray(gammas), errors))
            if errors.min() < least:
                least, self.width_ = errors.min(), width
                self.gamma_ = gammas[int(np.argmin(errors))]
                self.centres_, self.projection_ = centres, projection

    def _features(self, x: Floats) -> Floats:
        parts = [
            rbf(x[i : i + CHUNK], self.centres_, self.width_) @ self.projection_
            for i in range(0, len(x), CHUNK)
        ]
        return np.vstack(parts)


def _whitening(centres: Floats, width: float) -> Floats:
    """Projection (m, k) from kernel values against the centres to Nystrom features."""
    values, vectors = np.linalg.eigh(rbf(centres, centres, width))
    kept = values > RANK * values[-1]
    return np.asarray(vectors[:, kept] / np.sqrt(values[kept]))
