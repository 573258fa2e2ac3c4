r"""Scatter of each run by its own block: normal equations without it, and what whitens it.

The columns of scatter of two runs share no reading, so that their part of the matrix of the normal
equations has one small block for each run. With Z the products of the scatter with the others:

.. math::
    M = \begin{pmatrix} D & Z \\ Z^T & A \end{pmatrix}, \quad D = \operatorname{diag}(D_r), \quad
    A' = A - Z^T D^{-1} Z, \quad \ln|M| = \sum_r \ln|D_r| + \ln|A'|

    M^{-1} = \begin{pmatrix} D^{-1} + Y A'^{-1} Y^T & -Y A'^{-1} \\ \cdot & A'^{-1} \end{pmatrix},
    \quad Y = D^{-1} Z

The cost grows with the number of runs, and no longer with its cube.

References: Golub and Van Loan, Matrix Computations, 4th edition, 2013, section 3.2.11 (the Schur
complement).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.fitting.covariance import Whitening

#: Eigenvalue of the products of a run's whitened scatter, over the largest, that is rounding.
LEAST_SCATTER = 1e-14


@dataclass(frozen=True, eq=False)
class Products:
    """Products by channel of what was whitened: scatter of R runs, and n other columns.

    runs (channels, R, s, s + n): Of the s columns of scatter of a run with each other, and with
        the others.
    others (channels, n, n): Of the others.
    counts (channels,): Readings that are kept.
    log_determinant: Of the noise at scale 1.
    """

    runs: Floats
    others: Floats
    counts: Floats
    log_determinant: float

    def taken(self, columns: Integers) -> Products:
        """The products of some of the others, in an order."""
        s = self.runs.shape[2]
        at = np.concatenate([np.arange(s), s + columns])
        return replace(
            self, runs=self.runs[..., at], others=self.others[:, columns[:, None], columns]
        )

    def eliminated(self, weight: Floats, std: Floats) -> Eliminated:
        """Without the scatter, of standard deviations (s,), under weights (channels,)."""
        channels, count, s, width = self.runs.shape
        total = (weight @ self.runs.reshape(channels, -1)).reshape(count, s, width)
        total *= std[:, None]
        block = total[:, :, :s] * std + np.eye(s)
        root = np.linalg.inv(np.linalg.cholesky(block))
        gain = root @ total[:, :, s:]
        flat = gain.reshape(count * s, width - s)
        n = width - s
        left = (weight @ self.others.reshape(channels, -1)).reshape(n, n) - flat.T @ flat
        diagonal = np.diagonal(root, axis1=1, axis2=2)
        return Eliminated(std, root, gain, left, -2.0 * float(np.log(diagonal).sum()))

    def summed(self, runs: Floats, others: Floats) -> Floats:
        """Sums (channels, k) of the products times k factors (k, R, s, s + n) and (k, n, n)."""
        channels, k = len(self.others), len(others)
        own = self.runs.reshape(channels, -1) @ runs.reshape(k, -1).T
        return np.asarray(own + self.others.reshape(channels, -1) @ others.reshape(k, -1).T)


@dataclass(frozen=True, eq=False)
class Eliminated:
    """The others once the scatter of all runs is eliminated.

    std (s,): Standard deviations of scatter.
    root (R, s, s): Inverse of the lower Cholesky factor of each block D_r.
    gain (R, s, n): The root times the products of the scatter with the others.
    left (n, n): Products of the others under the covariance with scatter.
    log_determinant: Sum of ln |D_r|.
    """

    std: Floats
    root: Floats
    gain: Floats
    left: Floats
    log_determinant: float

    @property
    def back(self) -> Floats:
        """Y (R, s, n): how the weights of scatter answer to those of the others."""
        return np.asarray(self.root.swapaxes(1, 2) @ self.gain)

    def weights(self, others: Floats) -> Floats:
        """Mean weights (R, s) of the scatter, given what the others (n,) leave: -beta, then 1."""
        return np.asarray(self.root.swapaxes(1, 2) @ (self.gain @ others)[..., None])[..., 0]


def by_cell(values: Floats, cell: Integers, cells: int) -> Any:
    """Sparse (m, cells s): values (m, s) in the columns of the cell of each row; none of none."""
    from scipy.sparse import csr_array

    m, s = values.shape
    if not cells:
        return csr_array((m, 0), dtype=np.float64)
    index = cell[:, None] * s + np.arange(s)
    return csr_array((values.ravel(), index.ravel(), s * np.arange(m + 1)), shape=(m, cells * s))


def scatter_whitening(noise: Any, change: Floats, run: Integers, runs: int) -> Whitening:
    """Whitening of noise and scatter from its change (m, s) by one standard deviation.

    The basis of each run is in the eigenvectors of the products of its columns.
    """
    white = noise[:, None] * change if noise.ndim == 1 else noise @ change
    s = white.shape[1]
    size, vectors = np.linalg.eigh(np.reshape(by_cell(white, run, runs).T @ white, (runs, s, s)))
    seen = size > LEAST_SCATTER * size.max(axis=1, initial=LEAST_SCATTER, keepdims=True)
    root = np.sqrt(np.where(seen, size, np.inf))
    own = np.einsum("ij,ijk->ik", white, vectors[run]) / root[run]
    shrinkage = np.where(seen, 1.0 - 1.0 / np.sqrt(1.0 + np.maximum(size, 0.0)), 0.0)
    return Whitening(noise, by_cell(own, run, runs), shrinkage.ravel())
