"""LS-SVM in the dual: one prototype for each row, solved exactly, at any size that memory holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from soilml.arrays import Floats
from training.regressors.ordered_threads import Progress
from training.regressors.rbf_expansion import (
    SCORING_STEPS,
    Expansion,
    log_squared_residuals,
    median_distance,
    rbf,
    scored_response,
)
from training.regressors.row_groups import Groups, folds_of
from training.regressors.tiled_cholesky import TiledCholesky, factor_bytes, tiles_of


@dataclass(frozen=True)
class KernelEigensystem:
    """Eigendecomposition of a kernel matrix; the solution for any gamma then costs O(n^2)."""

    values: Floats  # (n,)
    vectors: Floats  # (n, n)

    @staticmethod
    def of(kernel: Floats) -> KernelEigensystem:
        """Decompose a kernel matrix (n, n)."""
        return KernelEigensystem(*np.linalg.eigh(kernel))

    def solve(self, y: Floats, gamma: float) -> tuple[Floats, Floats]:
        r"""Dual weights (n, q) and bias (q,).

        .. math::
            \begin{bmatrix} 0 & 1^T \\ 1 & \Omega + I/\gamma \end{bmatrix}
            \begin{bmatrix} b^T \\ \alpha \end{bmatrix} =
            \begin{bmatrix} 0 \\ Y \end{bmatrix}

        References: Suykens and Vandewalle, Neural Processing Letters 9, 1999.
        """
        weights = 1.0 / (np.maximum(self.values, 0.0) + 1.0 / gamma)
        inverse_ones = self.vectors @ (weights * self.vectors.sum(axis=0))
        inverse_y = self.vectors @ (weights[:, None] * (self.vectors.T @ y))
        bias = inverse_ones @ y / inverse_ones.sum()
        return inverse_y - inverse_ones[:, None] * bias, bias


#: Searched unless fixed: widths in median distances between rows, and gammas.
WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
GAMMAS = tuple(10.0 ** (0.5 * k) for k in range(-6, 17))
#: Rows on which they are selected: an eigensystem takes some thirty times as long as a factor.
SEARCH_ROWS = 1000
#: Passes over the tiles: factor, and blocks of the inverse, for mean and log-variance.
PASSES = 4 + SCORING_STEPS


@dataclass(frozen=True)
class ExactSolution:
    """How an exact LS-SVM is solved; gamma and width are selected if None, on a seeded sample."""

    gamma: float | None
    width: float | None
    seed: int

    @property
    def name(self) -> str:
        """As in the spec."""
        return "exact"

    def solve(self, x: Floats, z: Floats, groups: Groups, progress: Progress) -> Expansion:
        """The expansion for standardised inputs (n, d) and outputs (n, q).

        Width and gamma are those of the least error on rows whose groups (n,) were left out, of at
        most `SEARCH_ROWS` rows. As 1 / gamma is the variance of the noise in the prior's units, it
        does not depend on the number of rows.
        """
        gammas = GAMMAS if self.gamma is None else (float(self.gamma),)
        some = np.random.default_rng(self.seed).permutation(len(x))[:SEARCH_ROWS]
        fold, median = folds_of(groups[some]), median_distance(x)
        widths = [w * median for w in WIDTHS] if self.width is None else [float(self.width)]
        order, slices = tiles_of(groups)
        with threadpool_limits(1):
            found = [_selected(x[some], z[some], fold, w, gammas) for w in widths]
            _, gamma, width, left = min(found, key=lambda entry: entry[0])
            logs = log_squared_residuals(z[some] - left)
            _, log_gamma, _, _ = _selected(x[some], logs, fold, width, GAMMAS)
        mean, log_variance = np.empty_like(z), np.empty_like(z)
        factor = TiledCholesky.of(x[order], width, gamma, slices, _part(progress, 0))
        alpha, bias, mean[order] = factor.regress(z[order], _part(progress, 1))
        logs = log_squared_residuals(z - mean)
        factor = TiledCholesky.of(x[order], width, log_gamma, slices, _part(progress, 2))
        for step in range(1 + SCORING_STEPS):
            if step:
                logs = scored_response(z - mean, log_variance)
            fitted = factor.regress(logs[order], _part(progress, 3 + step))
            log_alpha, log_bias, log_variance[order] = fitted
        return Expansion(
            solution=self.name,
            centres=x[order],
            width=width,
            gamma=gamma,
            alpha=alpha,
            bias=bias,
            log_variance_alpha=log_alpha,
            log_variance_bias=log_bias,
            left_out=(mean, log_variance),
        )

    def prototypes(self, rows: int) -> int:
        """Centres of the expansion."""
        return rows

    def bytes(self, rows: int, inputs: int, outputs: int) -> int:
        """Memory of a solution beyond its training rows."""
        some = 8 * 5 * min(rows, SEARCH_ROWS) ** 2
        return 8 * rows * (3 * inputs + 10 * outputs) + some + factor_bytes(rows)


def _selected(
    x: Floats, z: Floats, fold: Groups, width: float, gammas: tuple[float, ...]
) -> tuple[float, float, float, Floats]:
    """Least squared error of rows left out, its gamma, the width, and estimates (n, q) of them."""
    kernel, found = rbf(x, x, width), np.empty((len(gammas), *z.shape))
    for k in range(int(fold.max()) + 1):
        out = fold == k
        system = KernelEigensystem.of(kernel[np.ix_(~out, ~out)])
        for i, gamma in enumerate(gammas):
            alpha, bias = system.solve(z[~out], gamma)
            found[i, out] = kernel[np.ix_(out, ~out)] @ alpha + bias
    errors = ((found - z) ** 2).sum(axis=(1, 2))
    best = int(np.argmin(errors))
    return float(errors[best]), gammas[best], width, found[best]


def _part(progress: Progress, number: int) -> Progress:
    """Progress of one pass."""
    return lambda done, count: progress(number * count + done, PASSES * count)
