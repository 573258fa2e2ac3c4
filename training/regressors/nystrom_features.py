"""Nystrom features of prototype rows, and ridge regression on them from streamed moments."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from soilml.arrays import Floats
from soilml.processes import usable_cores
from training.regressors.gaussian_regressor import Groups, Progress

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Rows that centres are selected from, at least and for each centre; and exchanges per centre.
CANDIDATES, CANDIDATES_PER_CENTRE = 4000, 10
TRIALS_PER_CENTRE = 30


def rbf(a: Floats, b: Floats, width: float) -> Floats:
    r"""Kernel matrix (len(a), len(b)), `exp(-|a - b|^2 / (2 width^2))`."""
    squared = (a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1)[None, :] - 2.0 * (a @ b.T)
    return np.asarray(np.exp(-np.maximum(squared, 0.0) / (2.0 * width * width)))


def median_distance(x: Floats) -> float:
    """Median distance between rows (n, d), of at most 400 of them: the unit of kernel widths."""
    sample = x[np.random.default_rng(0).permutation(len(x))[:400]]
    distance = np.sqrt(((sample[:, None, :] - sample[None, :, :]) ** 2).sum(axis=-1))
    pairs = np.triu_indices(len(sample), 1)
    median = float(np.median(distance[pairs])) if len(sample) > 1 else 1.0
    return median if median > 0.0 else 1.0


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

    def project(self, features: Floats) -> Floats:
        """Centred features (n, m) along the eigenvectors."""
        return np.asarray((features - self.mean) @ self.vectors)

    def solve(self, moment: Floats, gamma: float) -> Floats:
        """Weights (m, q) along the eigenvectors, from moments (m, q) of centred features and y."""
        return np.asarray((self.vectors.T @ moment) / (self.values + 1.0 / gamma)[:, None])


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


@dataclass(frozen=True)
class FoldedRidge:
    """Ridge regressions on features of rows: without each fold of them, and on all.

    Rows (n, d) are read in parts, fold by fold.
    """

    features: NystromFeatures
    x: Floats
    parts: list[tuple[int, NDArray[np.int64]]]  # a fold, and some of its rows
    origin: Floats  # (k,) near the mean of the features: sums of differences from it are accurate
    sums: list[Floats]  # (k,) of each fold
    fits: list[RidgeEigensystem]  # without each fold; the last on all rows

    @staticmethod
    def of(features: NystromFeatures, x: Floats, fold: Groups, progress: Progress) -> FoldedRidge:
        """The regressions for rows (n, d), of which each fold (n,) is left out once."""
        parts = [
            (k, rows[i : i + CHUNK])
            for k in range(int(fold.max()) + 1)
            for rows in [np.flatnonzero(fold == k)]
            for i in range(0, len(rows), CHUNK)
        ]
        origin = features.at(x[:CHUNK]).mean(axis=0)

        def products(part: tuple[int, NDArray[np.int64]]) -> tuple[Floats, Floats]:
            own = features.at(x[part[1]]) - origin
            return own.sum(axis=0), own.T @ own

        count, size = np.bincount(fold), len(origin)
        sums = [np.zeros(size) for _ in count]
        grams = [np.zeros((size, size)) for _ in count]
        for done, ((k, _), (total, gram)) in enumerate(
            zip(parts, ordered_map(products, parts), strict=True)
        ):
            sums[k] += total
            grams[k] += gram
            progress(done + 1, len(parts))
        whole, gram = np.sum(sums, axis=0), np.sum(grams, axis=0)
        fits = [
            RidgeEigensystem.of_moments(len(x) - n, origin, whole - own, gram - of_fold)
            for n, own, of_fold in zip(
                [*count, 0], [*sums, 0.0 * origin], [*grams, 0.0 * gram], strict=True
            )
        ]
        return FoldedRidge(features, x, parts, origin, sums, fits)

    def regress(
        self, y: Floats, gammas: Sequence[float], most: int
    ) -> tuple[float, float, Floats, Floats, Floats]:
        """Least squares of y (n, q) with the best gamma, by the rows that are left out.

        most: About so many rows select gamma.

        Returns: Gamma, its mean squared error, weights (k, q) of the features and bias (q,) of the
        fit to all rows, and estimates (n, q) of the rows by fits without their folds.
        """
        moments, means = self._moments(y)
        solved = {
            gamma: [
                fit.solve(moment, gamma) for fit, moment in zip(self.fits, moments, strict=True)
            ]
            for gamma in gammas
        }
        errors, some = np.zeros(len(gammas)), max(most // CHUNK, len(self.fits) - 1)
        for k, rows in self.parts[:: max(len(self.parts) // some, 1)]:
            projected = self.fits[k].project(self.features.at(self.x[rows]))
            for i, gamma in enumerate(gammas):
                left = y[rows] - means[k] - projected @ solved[gamma][k]
                errors[i] += np.sum(left**2)
        gamma = gammas[int(np.argmin(errors))]
        found = np.empty_like(y)

        def predict(part: tuple[int, NDArray[np.int64]]) -> Floats:
            k, rows = part
            projected = self.fits[k].project(self.features.at(self.x[rows]))
            return np.asarray(means[k] + projected @ solved[gamma][k])

        for (_, rows), own in zip(self.parts, ordered_map(predict, self.parts), strict=True):
            found[rows] = own
        whole = self.fits[-1]
        weights = whole.vectors @ solved[gamma][-1]
        return gamma, float(errors.min()), weights, means[-1] - whole.mean @ weights, found

    def _moments(self, y: Floats) -> tuple[list[Floats], list[Floats]]:
        """Products (k, q) of centred features and y, and means (q,) of y, of each fit."""
        folds = len(self.fits) - 1
        products = [np.zeros((len(self.origin), y.shape[1])) for _ in range(folds)]
        totals = [np.zeros(y.shape[1]) for _ in range(folds)]

        def product(part: tuple[int, NDArray[np.int64]]) -> Floats:
            return np.asarray((self.features.at(self.x[part[1]]) - self.origin).T @ y[part[1]])

        for (k, rows), own in zip(self.parts, ordered_map(product, self.parts), strict=True):
            products[k] += own
            totals[k] += y[rows].sum(axis=0)
        moments, means = [], []
        for k, fit in enumerate(self.fits):
            others = [j for j in range(folds) if j != k]
            total = sum(totals[j] for j in others)
            mean = total / fit.count
            features = sum(self.sums[j] for j in others)
            moments.append(sum(products[j] for j in others) - np.outer(features, mean))
            means.append(np.asarray(mean))
        return moments, means


def ordered_map(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Results of a function of each item, in order, in one thread for each usable core.

    Each call uses one thread of linear algebra, which releases the interpreter's lock.
    """
    with threadpool_limits(1), ThreadPoolExecutor(usable_cores()) as pool:
        return list(pool.map(function, items))
