"""Least squares support vector regression on prototype rows, with several outputs."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from soilml.arrays import Floats
from training.onnx_graph.value import Tensor, affine, exp, halves, squared_distances
from training.regressors.gaussian_regressor import (
    GaussianRegressor,
    Groups,
    Progress,
    folds_of,
    log_squared_residuals,
)
from training.regressors.nystrom_features import (
    FoldedRidge,
    NystromFeatures,
    median_distance,
    select_by_renyi_entropy,
)

#: Searched unless fixed: widths in median distances between rows, and gammas.
WIDTHS = (0.5, 1.0, 1.5, 2.0, 3.0)
GAMMAS = tuple(10.0**k for k in range(-6, 9))
SEARCH_ROWS = 8000  # Rows on which the width is selected, and about as many that select gamma
#: Steps of Fisher scoring after the fit to logarithms, and the largest squared error over variance.
SCORING_STEPS, MOST_SQUARE = 2, 20.0
#: Elements of the kernel matrix that a prediction computes at a time.
PREDICTED_AT_A_TIME = 500_000


class LSSVM(GaussianRegressor):
    r"""Least squares support vector regression with bias, Gaussian kernel, any number of outputs.

    .. math:: f(x) = \sum_j \alpha_j k(x, c_j) + b

    It is solved in the primal, on Nystrom features of a subset of the rows with large Renyi
    entropy. Rows are read in parts: time is proportional to their number, memory hardly depends on
    it. With as many centres as rows, every row is one.

    Parameters
    ----------
    centres : int
        Size of the subset, and of the exported model.
    gamma : float, optional
        Weight of the errors against smoothness; selected if None, by the error on rows left out,
        in closed form.
    width : float, optional
        Kernel width in standardised inputs; selected in the same way if None, on some of the rows.
    random_state : int
        Seed of these rows, and of the selection of centres.

    Notes
    -----
    The log-variance is a second expansion on the same kernel, fitted to the logarithms of the
    squared residuals of rows that were left out. More centres reduce the error only while the
    function varies over less than their distance; the inverse problem from a single reading does
    not.

    References: Suykens et al., Least Squares Support Vector Machines, 2002, chapter 6; Williams and
    Seeger, NIPS 13, 2001 (Nystrom); De Brabanter et al., Computational Statistics and Data Analysis
    54(6), 2010 (large data sets).

    Examples
    --------
    >>> import numpy as np
    >>> x = np.linspace(0.0, 6.0, 40)[:, None]
    >>> mean = LSSVM().fit(x, np.sin(x[:, 0])).predict([[1.5]])
    >>> print(np.round(mean, 2))
    [1.]
    """

    type_name: ClassVar[str] = "fixed-size-lssvm"

    def __init__(
        self,
        centres: int = 150,
        gamma: float | None = None,
        width: float | None = None,
        random_state: int = 0,
    ) -> None:
        self.centres, self.random_state = centres, random_state
        self.gamma, self.width = gamma, width

    def _fit_standardised(self, x: Floats, z: Floats, groups: Groups, progress: Progress) -> None:
        gammas = GAMMAS if self.gamma is None else (float(self.gamma),)
        features, fold = self._select_width(x, z, groups, gammas), folds_of(groups)
        ridge = FoldedRidge.of(features, x, fold, progress)
        self.gamma_, _, weights, bias, mean = ridge.regress(z, gammas, SEARCH_ROWS)
        response = log_squared_residuals(z - mean)
        for _ in range(1 + SCORING_STEPS):
            fitted = ridge.regress(response, GAMMAS, SEARCH_ROWS)
            _, _, log_weights, log_bias, log_variance = fitted
            response = scored_response(z - mean, log_variance)
        self.centres_, self.width_ = features.centres, features.width
        self.weights_ = features.projection @ np.hstack([weights, log_weights])
        self.bias_, self._by_others = np.concatenate([bias, log_bias]), (mean, log_variance)

    def _select_width(
        self, x: Floats, z: Floats, groups: Groups, gammas: tuple[float, ...]
    ) -> NystromFeatures:
        """The features with the best width."""
        median = median_distance(x)
        widths = [w * median for w in WIDTHS] if self.width is None else [float(self.width)]
        some = np.random.default_rng(self.random_state).permutation(len(x))[:SEARCH_ROWS]
        fold, least = folds_of(groups[some]), np.inf
        for width in widths:
            chosen = select_by_renyi_entropy(x, self.centres, width, self.random_state)
            features, error = NystromFeatures.of(x[chosen], width), 0.0
            if len(widths) > 1:
                ridge = FoldedRidge.of(features, x[some], fold, lambda done, total: None)
                error = ridge.regress(z[some], gammas, SEARCH_ROWS)[1]
            if error < least:
                least, best = error, features
        return best

    def _left_out(
        self, x: Floats, z: Floats, groups: Groups, progress: Progress
    ) -> tuple[Floats, Floats]:
        """In closed form, as part of the fit."""
        return self._by_others

    @property
    def rows_at_a_time(self) -> float:  # type: ignore[override]
        """Rows whose kernel matrix is computed at a time."""
        return PREDICTED_AT_A_TIME / len(self.centres_)

    def _input_factor(self) -> float:
        """With x and centres divided by sqrt(2) width the kernel is exp(-|x - c|^2)."""
        return float(1.0 / (np.sqrt(2.0) * self.width_))

    def _standardised_outputs(self, x: Tensor) -> tuple[Tensor, Tensor]:
        kernel = exp(-squared_distances(x, self.centres_ * self._input_factor()))
        mean, log_variance = halves(affine(kernel, self.weights_, self.bias_))
        return mean, log_variance

    def fitted_settings(self) -> str:
        """Number of centres, gamma and width."""
        size = f"fixed-size, {len(self.centres_)} centres"
        return f"{size}, gamma {self.gamma_:.3g}, width {self.width_:.3g}"


def scored_response(residual: Floats, log_variance: Floats) -> Floats:
    r"""Working response (n, q) of a step of Fisher scoring for a log-variance :math:`\eta`.

    .. math:: u = \eta + r^2 e^{-\eta} - 1

    Its least squares fit is a step towards the largest Gaussian likelihood, whose information on
    a log-variance is the same for all rows. Logarithms of squared residuals, from which the steps
    start, have 2.5 times its variance, and a bias where errors are not Gaussian.

    References: Smyth, J. Royal Statistical Society B 51(1), 1989.
    """
    square = np.minimum(residual**2 * np.exp(-log_variance), MOST_SQUARE)
    return np.asarray(log_variance + square - 1.0)
