"""LS-SVM in the primal, on Nystrom features of some prototype rows; memory does not grow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from training.regressors.nystrom_features import (
    NystromFeatures,
    RidgeEigensystem,
    select_by_renyi_entropy,
    streaming_bytes,
)
from training.regressors.ordered_threads import Progress
from training.regressors.rbf_expansion import (
    Expansion,
    Rows,
    Search,
    by_error,
    log_squared_residuals,
    median_distance,
    usable_validation,
)

#: Searched unless fixed: widths in median distances between rows, and gammas.
WIDTHS = (0.5, 1.0, 1.5, 2.0, 3.0)
GAMMAS = tuple(10.0**k for k in range(-6, 9))
#: Rows on which the width is selected, and on which the range of the log-variance is measured.
SEARCH_ROWS, RANGE_ROWS = 8000, 50000
PASSES = 3  # Passes over the rows: of the Gram matrix, of the residuals, and of the log-variance


@dataclass(frozen=True)
class FixedSizeSolution:
    """How a fixed-size LS-SVM is solved.

    References: Suykens et al., Least Squares Support Vector Machines, 2002, chapter 6; De Brabanter
    et al., Computational Statistics and Data Analysis 54, 2010 (large data sets).
    """

    centres: int  # number of prototype rows
    #: selected if None
    gamma: float | None
    width: float | None
    seed: int  # of the selection of prototypes

    @property
    def name(self) -> str:
        """As in the spec."""
        return "fixed-size"

    def solve(self, x: Floats, z: Floats, validation: Rows | None, progress: Progress) -> Expansion:
        """The expansion for standardised inputs (n, d) and outputs (n, q).

        The width is selected on some of the rows, gamma on all of them: by the error on validation
        rows, and where there are too few by leave-one-out.
        """
        gammas = GAMMAS if self.gamma is None else (float(self.gamma),)
        validation = usable_validation(validation)
        steps = _Steps(progress)
        sample = np.random.default_rng(self.seed).permutation(len(x))[:SEARCH_ROWS]
        features, origin, search = self._select_width(x, z, sample, gammas, validation)
        mean = z.mean(axis=0)
        ridge, moment = features.ridge(x, z - mean, origin, steps.part(0))
        rows = (x[sample], z[sample])
        errors = _errors(features, ridge, moment, mean, gammas, sample=rows, validation=validation)
        gamma = gammas[int(np.argmin(errors))]
        search[-1] = (features.width, np.asarray(gammas), errors)
        weights = ridge.solve(moment, gamma)
        residual = np.empty_like(z)
        for part, projected in features.projected(x, ridge):
            centred = z[part] - mean
            residual[part] = ridge.leave_one_out(projected, centred, weights, gamma)
            steps.part(1)(part.stop, len(x))
        logs = log_squared_residuals(residual)
        log_mean = logs.mean(axis=0)
        log_moment = features.moment(x, logs - log_mean, ridge, steps.part(2))
        rows = (x[sample], logs[sample])
        errors = _errors(features, ridge, log_moment, log_mean, GAMMAS, sample=rows)
        log_weights = ridge.solve(log_moment, GAMMAS[int(np.argmin(errors))])
        along = features.projection @ ridge.vectors
        shift = ridge.mean @ ridge.vectors
        log_alpha, log_bias = along @ log_weights, log_mean - shift @ log_weights
        some = np.random.default_rng(self.seed + 1).permutation(len(x))[:RANGE_ROWS]
        return Expansion(
            solution=self.name,
            centres=features.centres,
            width=features.width,
            gamma=gamma,
            alpha=along @ weights,
            bias=mean - shift @ weights,
            log_variance_alpha=log_alpha,
            log_variance_bias=log_bias,
            log_variances=np.concatenate(
                [log_mean + p @ log_weights for _, p in features.projected(x[some], ridge)]
            ),
            residual=residual,
            search=search,
        )

    def prototypes(self, rows: int) -> int:
        """Centres of the expansion."""
        return min(self.centres, rows)

    def bytes(self, rows: int, inputs: int, outputs: int) -> int:
        """Memory of a solution beyond its training rows: scaled copies, residuals and chunks."""
        growing = 8 * rows * (2 * inputs + 5 * outputs)
        return growing + streaming_bytes(self.prototypes(rows)) + SMALL_BYTES

    def _select_width(
        self,
        x: Floats,
        z: Floats,
        sample: NDArray[np.int64],
        gammas: tuple[float, ...],
        validation: Rows | None,
    ) -> tuple[NystromFeatures, Floats, Search]:
        """The features with the best width, their mean on the sample, and all errors."""
        median = median_distance(x)
        widths = [w * median for w in WIDTHS] if self.width is None else [float(self.width)]
        rows = (x[sample], z[sample])
        candidates: dict[float, tuple[NystromFeatures, Floats]] = {}
        search: Search = []
        for width in widths:
            chosen = select_by_renyi_entropy(x, self.centres, width, self.seed)
            features = NystromFeatures.of(x[chosen], width)
            values = features.at(rows[0])
            ridge, mean = RidgeEigensystem.of(values), rows[1].mean(axis=0)
            moment = (values - ridge.mean).T @ (rows[1] - mean)
            errors = _errors(
                features, ridge, moment, mean, gammas, sample=rows, validation=validation
            )
            search.append((width, np.asarray(gammas), errors))
            candidates[width] = features, ridge.mean
        search = by_error(search)
        return *candidates[search[-1][0]], search


def _errors(
    features: NystromFeatures,
    ridge: RidgeEigensystem,
    moment: Floats,
    mean: Floats,
    gammas: tuple[float, ...],
    *,
    sample: Rows,
    validation: Rows | None = None,
) -> Floats:
    """Mean squared error of each gamma on validation rows, else of leaving out rows of a sample."""
    x, y = sample if validation is None else validation
    projected = ridge.project(features.at(x))
    centred = y - mean
    errors = []
    for gamma in gammas:
        weights = ridge.solve(moment, gamma)
        if validation is None:
            residual = ridge.leave_one_out(projected, centred, weights, gamma)
        else:
            residual = centred - projected @ weights
        errors.append(np.mean(residual**2))
    return np.asarray(errors)


SMALL_BYTES = 1 << 20  # Arrays and objects that grow neither with the rows nor with the prototypes


class _Steps:
    """Progress of the passes, as one count."""

    def __init__(self, progress: Progress) -> None:
        self.progress = progress

    def part(self, number: int) -> Progress:
        """Progress of one pass."""
        return lambda done, total: self.progress(number * total + done, PASSES * total)
