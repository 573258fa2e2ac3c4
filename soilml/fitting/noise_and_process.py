"""Readings with independent noise and a smooth process: whitening and likelihood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Whitener:
    r"""The symmetric root of an inverse covariance of noise and process.

    .. math::
        (I + B B^T)^{-1/2} D^{-1}
        = \left[I - U \left(1 - (1 + s^2)^{-1/2}\right) U^T\right] D^{-1}, \quad
        D = \operatorname{diag}(\sigma), \quad B = D^{-1} C = U s V^T

    For residuals r the squared length of the result is r^T (D D + C C^T)^{-1} r. It costs k q
    operations for k readings and q columns C.
    """

    std: Floats  # (k,)
    vectors: Floats  # (k, r)
    shrinkage: Floats  # (r,)

    @staticmethod
    def of(std: Floats, columns: Floats) -> Whitener:
        """From standard deviations (k,) of the noise and columns (k, q) of the process."""
        vectors, size, _ = np.linalg.svd(columns / std[:, None], full_matrices=False)
        return Whitener(std, vectors, 1.0 - 1.0 / np.sqrt(1.0 + size**2))

    def __call__(self, values: Floats) -> Floats:
        """Values (..., k), such as residuals or the columns of a Jacobian, whitened."""
        scaled = values / self.std
        return np.asarray(scaled - ((scaled @ self.vectors) * self.shrinkage) @ self.vectors.T)


def squared_residuals_and_log_determinant(
    residual: Floats, std: Floats, columns: Floats
) -> tuple[Floats, Floats]:
    r"""r^T S^-1 r and half of ln det S, (n,) each, for S = diag(std^2) + C C^T.

    .. math::
        r^T S^{-1} r = |D^{-1} r - B w|^2 + |w|^2, \quad w = (I + B^T B)^{-1} B^T D^{-1} r, \quad
        \det S = \det(D)^2 \det(I + B^T B)

    The first form has no cancellation, however small the noise is beside the process.

    Parameters
    ----------
    residual, std : array (n, k)
        Residuals, and standard deviations of the noise; each of the n sets has its own.
    columns : array (k, q) or (n, k, q)
        C, the columns of the process.

    References
    ----------
    Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eqs. A.9 and A.10 (the
    lemmas of matrix inversion and of determinants).
    """
    if (std == std[0]).all():  # one factorisation for all sets
        std = std[:1]
    scaled = residual / std
    log_determinant = np.broadcast_to(np.log(std).sum(axis=1), len(residual))
    if columns.shape[-1] == 0:
        return (scaled**2).sum(axis=1), log_determinant
    basis = columns / std[..., None]
    transposed = np.swapaxes(basis, 1, 2)
    inner = transposed @ basis + np.eye(columns.shape[-1])
    weights = np.linalg.solve(inner, transposed @ scaled[..., None])
    left = scaled - (basis @ weights)[..., 0]
    squared = (left**2).sum(axis=1) + (weights[..., 0] ** 2).sum(axis=1)
    return squared, log_determinant + 0.5 * np.linalg.slogdet(inner)[1]
