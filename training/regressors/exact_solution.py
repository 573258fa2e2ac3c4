"""LS-SVM in the dual: one prototype for each row, solved exactly, at any size that memory holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from soilml.arrays import Floats
from training.regressors.ordered_threads import Progress
from training.regressors.rbf_expansion import (
    MOST_VALIDATION_ROWS,
    Expansion,
    Rows,
    Search,
    by_error,
    log_squared_residuals,
    median_distance,
    rbf,
    usable_validation,
)
from training.regressors.tiled_cholesky import TiledCholesky, factor_bytes


@dataclass(frozen=True)
class KernelEigensystem:
    """Eigendecomposition of a kernel matrix; the solution for any gamma then costs O(n^2)."""

    values: Floats  # (n,)
    vectors: Floats  # (n, n)

    @staticmethod
    def of(kernel: Floats) -> KernelEigensystem:
        """Decompose a kernel matrix (n, n)."""
        return KernelEigensystem(*np.linalg.eigh(kernel))

    def solve(self, y: Floats, gamma: float) -> tuple[Floats, Floats, Floats]:
        r"""Dual weights (n, q), bias (q,) and leave-one-out residuals (n, q).

        .. math::
            \begin{bmatrix} 0 & 1^T \\ 1 & \Omega + I/\gamma \end{bmatrix}
            \begin{bmatrix} b^T \\ \alpha \end{bmatrix} =
            \begin{bmatrix} 0 \\ Y \end{bmatrix}, \qquad e_i = \alpha_i / (H^{-1})_{ii}

        References: Suykens and Vandewalle, Neural Processing Letters 9, 1999; closed-form
        leave-one-out: Cawley and Talbot, Neural Networks 17(10), 2004.
        """
        weights = 1.0 / (np.maximum(self.values, 0.0) + 1.0 / gamma)
        ones = self.vectors.sum(axis=0)
        inverse_ones = self.vectors @ (weights * ones)
        total = float(ones @ (weights * ones))
        inverse_y = self.vectors @ (weights[:, None] * (self.vectors.T @ y))
        bias = inverse_ones @ y / total
        alpha = inverse_y - inverse_ones[:, None] * bias
        diagonal = (self.vectors**2) @ weights - inverse_ones**2 / total
        return alpha, bias, alpha / diagonal[:, None]

    def leave_one_out_errors(self, y: Floats, gammas: tuple[float, ...]) -> Floats:
        """Mean squared leave-one-out error of each gamma."""
        return np.asarray([np.mean(self.solve(y, g)[2] ** 2) for g in gammas])

    def validation_errors(
        self, y: Floats, kernel: Floats, truth: Floats, gammas: tuple[float, ...]
    ) -> Floats:
        """Mean squared error of each gamma at rows (k, q) with a kernel (k, n) to the rows here."""
        errors = []
        for gamma in gammas:
            alpha, bias, _ = self.solve(y, gamma)
            errors.append(np.mean((kernel @ alpha + bias - truth) ** 2))
        return np.asarray(errors)


#: Searched unless fixed: widths in median distances between rows, and gammas.
WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
GAMMAS = tuple(10.0 ** (0.5 * k) for k in range(-6, 17))
#: Most rows whose kernel matrix is decomposed, which takes some thirty times as long as a factor.
EIGENSYSTEM_ROWS = 1500
PASSES = 3  # Passes over the tiles: factor, diagonal of the inverse, factor for the log-variance


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

    def solve(self, x: Floats, z: Floats, validation: Rows | None, progress: Progress) -> Expansion:
        """The expansion for standardised inputs (n, d) and outputs (n, q).

        Width and gamma are selected on at most `EIGENSYSTEM_ROWS` rows: by the error on validation
        rows, and where there are too few by leave-one-out. As 1 / gamma is the variance of the
        noise in the prior's units, it does not depend on the number of rows.
        """
        gammas = GAMMAS if self.gamma is None else (float(self.gamma),)
        sample = np.arange(len(x))
        if len(x) > EIGENSYSTEM_ROWS:
            sample = np.random.default_rng(self.seed).permutation(len(x))[:EIGENSYSTEM_ROWS]
        with threadpool_limits(1):
            some, search = self._select(x[sample], z[sample], gammas, usable_validation(validation))
            width, _, found = search[-1]
            gamma = gammas[int(np.argmin(found))]
            alpha, bias, residual = some.solve(z[sample], gamma)
            logs = log_squared_residuals(residual)
            errors = some.leave_one_out_errors(logs, GAMMAS)
            log_gamma = GAMMAS[int(np.argmin(errors))]
            log_alpha, log_bias, _ = some.solve(logs, log_gamma)
        if len(sample) < len(x):
            alpha, bias, residual = _solve_tiles(x, z, width, gamma, _third(progress, 0))
            logs = log_squared_residuals(residual)
            factor = TiledCholesky.of(x, width, log_gamma, _third(progress, 2))
            log_alpha, log_bias, _ = _with_bias(factor, logs)
        return Expansion(
            solution=self.name,
            centres=x,
            width=width,
            gamma=gamma,
            alpha=alpha,
            bias=bias,
            log_variance_alpha=log_alpha,
            log_variance_bias=log_bias,
            log_variances=logs - log_alpha / log_gamma,
            residual=residual,
            search=search,
        )

    def prototypes(self, rows: int) -> int:
        """Centres of the expansion."""
        return rows

    def bytes(self, rows: int, inputs: int, outputs: int) -> int:
        """Memory of a solution beyond its training rows."""
        few = min(rows, EIGENSYSTEM_ROWS)
        some = 8 * few * (5 * few + 3 * MOST_VALIDATION_ROWS)
        tiles = factor_bytes(rows) if rows > EIGENSYSTEM_ROWS else 0
        return 8 * rows * (2 * inputs + 8 * outputs) + some + tiles

    def _select(
        self, x: Floats, z: Floats, gammas: tuple[float, ...], validation: Rows | None
    ) -> tuple[KernelEigensystem, Search]:
        """The eigensystem of the best width, and all errors."""
        median = median_distance(x)
        widths = [w * median for w in WIDTHS] if self.width is None else [float(self.width)]
        least = np.inf
        search: Search = []
        for width in widths:
            system = KernelEigensystem.of(rbf(x, x, width))
            if validation is None:
                errors = system.leave_one_out_errors(z, gammas)
            else:
                kernel = rbf(validation[0], x, width)
                errors = system.validation_errors(z, kernel, validation[1], gammas)
            search.append((width, np.asarray(gammas), errors))
            if errors.min() < least:
                least, best = errors.min(), system
        return best, by_error(search)


def _solve_tiles(
    x: Floats, z: Floats, width: float, gamma: float, progress: Progress
) -> tuple[Floats, Floats, Floats]:
    """Dual weights, bias and leave-one-out residuals; see `KernelEigensystem.solve`."""
    factor = TiledCholesky.of(x, width, gamma, lambda done, count: progress(done, 2 * count))
    alpha, bias, inverse_ones = _with_bias(factor, z)
    diagonal = factor.inverse_diagonal(lambda done, count: progress(count + done, 2 * count))
    diagonal -= inverse_ones**2 / inverse_ones.sum()
    return alpha, bias, alpha / diagonal[:, None]


def _with_bias(factor: TiledCholesky, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Dual weights (n, q), bias (q,), and the solution (n,) with ones on the right."""
    inverse = factor.solve(np.column_stack([np.ones(len(y)), y]))
    bias = inverse[:, 1:].sum(axis=0) / inverse[:, 0].sum()
    return inverse[:, 1:] - inverse[:, :1] * bias, bias, inverse[:, 0]


def _third(progress: Progress, first: int) -> Progress:
    """Progress of the passes from one on."""
    return lambda done, count: progress(first * count + done, PASSES * count)
