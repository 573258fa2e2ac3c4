"""Nystrom features of a kernel, computed for some rows at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.regressors.kernel.ordered_threads import Progress, ordered_map, thread_count
from training.regressors.kernel.rbf_kernel import rbf
from training.regressors.kernel.ridge_eigensystem import RidgeEigensystem

Floats = NDArray[np.float64]

#: Rows whose features are computed at a time in each thread.
CHUNK = 4096
#: Eigenvalues of the centres' kernel matrix below this share of the largest are rounding errors.
RANK_TOLERANCE = 1e-11


@dataclass(frozen=True)
class NystromFeatures:
    r"""Features (n, k) whose products approximate the kernel: :math:`K_{nm} K_{mm}^{-1/2}`.

    References
    ----------
    Williams and Seeger, NIPS 13, 2001; Suykens et al., Least Squares Support Vector Machines, 2002,
    chapter 6.
    """

    centres: Floats  # (m, d)
    width: float
    projection: Floats  # (m, k)

    @staticmethod
    def of(centres: Floats, width: float) -> NystromFeatures:
        """The features of centres (m, d)."""
        values, vectors = np.linalg.eigh(rbf(centres, centres, width))
        significant = values > RANK_TOLERANCE * values[-1]
        projection = vectors[:, significant] / np.sqrt(values[significant])
        return NystromFeatures(centres, width, np.asarray(projection))

    def at(self, x: Floats) -> Floats:
        """Features (n, k) of rows (n, d), all at once."""
        return np.asarray(rbf(x, self.centres, self.width) @ self.projection)

    def ridge(
        self, x: Floats, y: Floats, origin: Floats, progress: Progress
    ) -> tuple[RidgeEigensystem, Floats]:
        """The ridge regression on all rows (n, d), and its moments (k, q) with centred y (n, q).

        `origin` (k,) is near the mean of the features: sums of differences from it are accurate.
        """

        def sums(rows: slice) -> tuple[Floats, Floats, Floats]:
            features = self.at(x[rows]) - origin
            return features.sum(axis=0), features.T @ features, features.T @ y[rows]

        size = len(origin)
        totals = np.zeros(size), np.zeros((size, size)), np.zeros((size, y.shape[1]))
        parts = _chunks(len(x))
        for done, found in enumerate(ordered_map(sums, parts)):
            for total, part in zip(totals, found, strict=True):
                total += part
            progress(done + 1, len(parts))
        return RidgeEigensystem.of_moments(len(x), origin, *totals[:2]), totals[2]

    def moment(self, x: Floats, y: Floats, ridge: RidgeEigensystem, progress: Progress) -> Floats:
        """Products (k, q) of centred features of all rows (n, d) and centred y (n, q)."""

        def product(rows: slice) -> Floats:
            return np.asarray(rbf(x[rows], self.centres, self.width).T @ y[rows])

        total = np.zeros((len(self.centres), y.shape[1]))
        parts = _chunks(len(x))
        for done, part in enumerate(ordered_map(product, parts)):
            total += part
            progress(done + 1, len(parts))
        return np.asarray(self.projection.T @ total - np.outer(ridge.mean, y.sum(axis=0)))

    def projected(self, x: Floats, ridge: RidgeEigensystem) -> Iterator[tuple[slice, Floats]]:
        """Rows, and their centred features along the eigenvectors, for some rows at a time."""
        along = self.projection @ ridge.vectors
        shift = ridge.mean @ ridge.vectors

        def project(rows: slice) -> tuple[slice, Floats]:
            return rows, rbf(x[rows], self.centres, self.width) @ along - shift

        yield from ordered_map(project, _chunks(len(x)))


def streaming_bytes(prototypes: int) -> int:
    """Memory of the chunks of all threads, and of matrices of the prototypes."""
    threads = thread_count()
    chunks = (3 * threads + threads + 2) * CHUNK * prototypes  # at work, and waiting to be used
    return 8 * (chunks + (2 * threads + 8) * prototypes**2)


def _chunks(rows: int) -> list[slice]:
    return [slice(i, min(i + CHUNK, rows)) for i in range(0, rows, CHUNK)]
