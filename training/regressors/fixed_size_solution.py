"""LS-SVM in the primal, on Nystrom features of some prototype rows; memory does not grow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from training.regressors.nystrom_features import (
    FoldedRidge,
    NystromFeatures,
    select_by_renyi_entropy,
    streaming_bytes,
)
from training.regressors.ordered_threads import Progress
from training.regressors.rbf_expansion import (
    SCORING_STEPS,
    Expansion,
    log_squared_residuals,
    median_distance,
    scored_response,
)
from training.regressors.row_groups import Groups, folds_of

#: Searched unless fixed: widths in median distances between rows, and gammas.
WIDTHS = (0.5, 1.0, 1.5, 2.0, 3.0)
GAMMAS = tuple(10.0**k for k in range(-6, 9))
SEARCH_ROWS = 8000  # Rows on which the width is selected, and about as many that select gamma


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

    def solve(self, x: Floats, z: Floats, groups: Groups, progress: Progress) -> Expansion:
        """The expansion for standardised inputs (n, d) and outputs (n, q).

        Width and gamma are those of the least error on rows whose groups (n,) were left out; the
        width is selected on some of the rows, gamma on all of them.
        """
        gammas = GAMMAS if self.gamma is None else (float(self.gamma),)
        features, fold = self._select_width(x, z, groups, gammas), folds_of(groups)
        ridge = FoldedRidge.of(features, x, fold, progress)
        gamma, _, weights, bias, mean = ridge.regress(z, gammas, SEARCH_ROWS)
        logs = log_squared_residuals(z - mean)
        _, _, log_weights, log_bias, log_variance = ridge.regress(logs, GAMMAS, SEARCH_ROWS)
        for _ in range(SCORING_STEPS):
            logs = scored_response(z - mean, log_variance)
            _, _, log_weights, log_bias, log_variance = ridge.regress(logs, GAMMAS, SEARCH_ROWS)
        return Expansion(
            solution=self.name,
            centres=features.centres,
            width=features.width,
            gamma=gamma,
            alpha=features.projection @ weights,
            bias=bias,
            log_variance_alpha=features.projection @ log_weights,
            log_variance_bias=log_bias,
            left_out=(mean, log_variance),
        )

    def prototypes(self, rows: int) -> int:
        """Centres of the expansion."""
        return min(self.centres, rows)

    def bytes(self, rows: int, inputs: int, outputs: int) -> int:
        """Memory of a solution beyond its training rows: scaled copies, residuals and chunks."""
        growing = 8 * rows * (2 * inputs + 7 * outputs + 6)
        return growing + streaming_bytes(self.prototypes(rows)) + SMALL_BYTES

    def _select_width(
        self, x: Floats, z: Floats, groups: Groups, gammas: tuple[float, ...]
    ) -> NystromFeatures:
        """The features with the best width."""
        median = median_distance(x)
        widths = [w * median for w in WIDTHS] if self.width is None else [float(self.width)]
        some = np.random.default_rng(self.seed).permutation(len(x))[:SEARCH_ROWS]
        fold, least = folds_of(groups[some]), np.inf
        for width in widths:
            chosen = select_by_renyi_entropy(x, self.centres, width, self.seed)
            features = NystromFeatures.of(x[chosen], width)
            error = 0.0
            if len(widths) > 1:
                ridge = FoldedRidge.of(features, x[some], fold, lambda done, total: None)
                error = ridge.regress(z[some], gammas, SEARCH_ROWS)[1]
            if error < least:
                least, best = error, features
        return best


SMALL_BYTES = 1 << 20  # Arrays and objects that grow neither with the rows nor with the prototypes
