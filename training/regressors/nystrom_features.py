"""Nystrom features of prototype rows, and ridge regression on them from streamed moments."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from training.regressors.ordered_threads import Progress, ordered_map, thread_count
from training.regressors.rbf_expansion import rbf

#: Rows that centres are selected from, at least and for each centre; and exchanges per centre.
CANDIDATES, CANDIDATES_PER_CENTRE = 4000, 10
TRIALS_PER_CENTRE = 30


def select_by_renyi_entropy(x: Floats, count: int, width: float, seed: int) -> NDArray[np.int64]:
    r"""Indices (count,) of rows (n, d) whose quadratic Renyi entropy is large.

    .. math:: H = -\log \frac{1}{m^2} \sum_{ij} k(x_i, x_j)

    A random candidate replaces a random selected row wherever that increases H. Columns of the
    kernel matrix of the candidates are computed as they are needed.

    References: Suykens, Van Gestel, De Brabanter, De Moor and Vandewalle, Least Squares Support
    Vector Machines, World Scientific 2002, section 6.2 (fixed-size LS-SVM); Girolami, Neural
    Computation 14, 2002.
    """
    rng = np.random.default_rng(seed)
    candidates = rng.permutation(len(x))[: max(CANDIDATES, CANDIDATES_PER_CENTRE * count)]
    if count >= len(candidates):
        return np.sort(candidates)
    scaled = x[candidates] / (math.sqrt(2.0) * width)
    points = scaled.tolist()
    selected = np.arange(count)
    others = np.arange(count, len(candidates))
    # of each candidate with all selected rows
    kernel_sum = rbf(x[candidates], x[candidates[selected]], width).sum(axis=1)

    def column(row: int) -> Floats:
        return np.asarray(np.exp(-((scaled - scaled[row]) ** 2).sum(axis=1)))

    trials = TRIALS_PER_CENTRE * count
    pairs = zip(
        rng.integers(count, size=trials), rng.integers(len(others), size=trials), strict=True
    )
    for i, j in pairs:
        old, new = selected[i], others[j]
        between = math.exp(-(math.dist(points[old], points[new]) ** 2))
        # half the change of the sum over pairs; the diagonal of the kernel is 1
        if kernel_sum[new] - between < kernel_sum[old] - 1.0:
            kernel_sum += column(new) - column(old)
            selected[i], others[j] = new, old
    return np.sort(candidates[selected])


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


CHUNK = 4096  # Rows whose features are computed at a time in each thread
#: Eigenvalues of the centres' kernel matrix below this share of the largest are rounding errors.
RANK_TOLERANCE = 1e-11


@dataclass(frozen=True)
class NystromFeatures:
    r"""Features (n, k) whose products approximate the kernel: :math:`K_{nm} K_{mm}^{-1/2}`.

    References: Williams and Seeger, NIPS 13, 2001; Suykens et al., Least Squares Support Vector
    Machines, 2002, chapter 6.
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
