"""Base of the regressors: scikit-learn estimators of a mean and a variance, with ONNX export."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin, clone
from sklearn.utils.validation import check_is_fitted, validate_data

from soilml.arrays import Floats
from training.onnx_graph.value import Tensor, Value, exp, maximum, minimum

Groups = NDArray[np.int64]
#: Called with the steps done and the total number of steps.
Progress = Callable[[int, int], None]

RANGE_ROWS = 20_000  # Most training rows on which the range of the log-variance is measured
TAIL = 0.001  # Share of the training rows whose log-variances are clipped at either end
#: Fits that leave some rows out. With fewer groups than the third number, a fit without a quarter
#: of them would be clearly worse than that of all: there are more fits then.
FOLDS, MOST_FOLDS, FEW_GROUPS = 4, 20, 300
LOG_CHI2 = -1.2703628454614782  # Expectation of the logarithm of a squared standard normal variable
#: Share of their mean that is added to squared residuals, so that their logarithms are finite.
SQUARE_FLOOR = 1e-4


def few_groups(groups: Groups) -> bool:
    """Whether the rows (n,) are of few groups."""
    return len(np.unique(groups)) < FEW_GROUPS


def folds_of(groups: Groups) -> Groups:
    """Number of the fold (n,) that leaves each row out; rows of one group are in one fold."""
    names, code = np.unique(groups, return_inverse=True)
    count = min(len(names), MOST_FOLDS if few_groups(groups) else FOLDS)
    order = np.random.default_rng(0).permutation(len(names))
    return np.asarray((order % count)[code])


def log_squared_residuals(residual: Floats) -> Floats:
    """Targets (n, q) for a log-variance: logarithms of squared residuals, corrected for bias."""
    square = residual**2
    floor = SQUARE_FLOOR * square.mean(axis=0) + 1e-300
    return np.asarray(np.log(square + floor) - LOG_CHI2)


@dataclass(frozen=True)
class Standardisation:
    """Mean and standard deviation (d,) of columns; a constant column has the scale 1."""

    mean: Floats
    scale: Floats

    @staticmethod
    def of(values: Floats) -> Standardisation:
        """Mean and standard deviation of rows (n, d)."""
        scale = values.std(axis=0)
        tiny = 1e-12 * np.maximum(np.abs(values).max(axis=0), 1e-300)
        return Standardisation(values.mean(axis=0), np.where(scale > tiny, scale, 1.0))

    def apply(self, values: Floats) -> Floats:
        """Standardised rows."""
        return np.asarray((values - self.mean) / self.scale)

    def undo(self, values: Floats) -> Floats:
        """Rows in their original units."""
        return np.asarray(values * self.scale + self.mean)


@dataclass(frozen=True)
class GaussianHead:
    """Converts standardised outputs to mean and standard deviation in the units of y.

    The log-variance is clipped to its range on the training rows: outside their domain a regressor
    would extrapolate it without bound.
    """

    scaling: Standardisation
    low: Floats  # (q,) bounds of the log-variance
    high: Floats
    one_output: bool  # y was (n,)

    @staticmethod
    def of(scaling: Standardisation, log_variance: Floats, one_output: bool) -> GaussianHead:
        """From the log-variances (n, q) of the training rows."""
        low, high = np.quantile(log_variance, [TAIL, 1.0 - TAIL], axis=0)
        return GaussianHead(scaling, low, high, one_output)

    def in_original_units(self, mean: Tensor, log_variance: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and standard deviation (n, q)."""
        clipped = minimum(maximum(log_variance, self.low), self.high)
        std = exp(clipped * 0.5) * self.scaling.scale
        return mean * self.scaling.scale + self.scaling.mean, std


class GaussianRegressor(MultiOutputMixin, RegressorMixin, BaseEstimator, ABC):  # type: ignore[misc]
    """Base of the regressors: mean and log-variance of standardised outputs.

    A subclass has a `type_name` for the spec, hyperparameters as keyword arguments of `__init__`,
    and the two abstract methods, which know standardised inputs (n, d) and outputs (n, q) alone.

    Attributes
    ----------
    x_scaling_, y_scaling_ : Standardisation
        Of the inputs (d,) and outputs (q,).
    head_ : GaussianHead
        From standardised outputs to mean and standard deviation.
    """

    type_name: ClassVar[str]
    rows_at_a_time: float = 4096  # That are predicted

    x_scaling_: Standardisation
    y_scaling_: Standardisation
    head_: GaussianHead

    @abstractmethod
    def _fit_standardised(self, x: Floats, z: Floats, groups: Groups, progress: Progress) -> None:
        """Fit inputs x to outputs z; rows of one group (n,) share a part of their error."""

    @abstractmethod
    def _standardised_outputs(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and log-variance (n, q) of inputs times `_input_factor`.

        One formula for arrays, and for values of an ONNX graph in double precision: functions of
        `training.onnx_graph.value` take both.
        """

    def _add_standardised_outputs(self, x: Value) -> tuple[Value, Value]:
        """The same in an ONNX graph, where it needs another way."""
        return self._standardised_outputs(x)

    def _input_factor(self) -> float:
        """Factor on standardised inputs."""
        return 1.0

    def _outputs(self, x: Floats) -> tuple[Floats, Floats]:
        """Mean and log-variance (n, q) of standardised rows, computed in parts."""
        at_a_time = max(int(self.rows_at_a_time), 1)
        parts = [
            self._standardised_outputs(x[first : first + at_a_time] * self._input_factor())
            for first in range(0, len(x), at_a_time)
        ]
        mean, log_variance = (np.concatenate(part) for part in zip(*parts, strict=True))
        return mean, log_variance

    def _left_out(
        self, x: Floats, z: Floats, groups: Groups, progress: Progress
    ) -> tuple[Floats, Floats]:
        """Mean and log-variance (n, q) of each row, by a fit without its group; after the fit."""
        mean, log_variance, fold = np.empty_like(z), np.empty_like(z), folds_of(groups)
        for k in range(count := int(fold.max()) + 1):
            progress(k, count)
            out, other = fold == k, clone(self)
            other._fit_standardised(x[~out], z[~out], groups[~out], lambda done, total: None)
            mean[out], log_variance[out] = other._outputs(x[out])
        progress(count, count)
        return mean, log_variance

    def fit(self, X: Any, y: Any) -> Self:
        """Fit rows X (n, d) to y (n,) or (n, q)."""
        self._fit(X, y, None, lambda done, total: None)
        return self

    def fit_left_out(
        self, X: Any, y: Any, groups: Groups, progress: Progress, equal_std: bool = False
    ) -> tuple[Floats, Floats]:
        """Fit all rows X (n, d) to y (n, q), and estimate each row by a fit without its group.

        groups (n,): Rows of one number share a part of their error, such as those of one soil.
        equal_std: One standard deviation for all rows: few rows do not tell how it varies.

        Returns: Mean and standard deviation (n, q) of the rows, by fits that have not seen them.
        """
        x, z = self._fit(X, y, groups, progress)
        mean, log_variance = self._left_out(x, z, groups, progress)
        if equal_std:
            log_variance = np.zeros_like(z)
        self.head_ = GaussianHead.of(self.y_scaling_, log_variance, y.ndim == 1)
        return self.head_.in_original_units(mean, log_variance)

    def _fit(
        self, X: Any, y: Any, groups: Groups | None, progress: Progress
    ) -> tuple[Floats, Floats]:
        """Fit, and the standardised rows; every row is a group where there are none."""
        rules = {"multi_output": True, "y_numeric": True, "ensure_min_samples": 2}
        X, y = validate_data(self, X, y, dtype=np.float64, **rules)
        Y = y.reshape(len(y), -1).astype(np.float64)
        self.x_scaling_, self.y_scaling_ = Standardisation.of(X), Standardisation.of(Y)
        x, z = self.x_scaling_.apply(X), self.y_scaling_.apply(Y)
        self._fit_standardised(x, z, np.arange(len(x)) if groups is None else groups, progress)
        some = np.random.default_rng(1).permutation(len(x))[:RANGE_ROWS]
        log_variance = self._outputs(x[some])[1]
        self.head_ = GaussianHead.of(self.y_scaling_, log_variance, y.ndim == 1)
        return x, z

    def add_to_graph(self, features: Value) -> tuple[Value, Value]:
        """Add the fitted regressor to an ONNX graph; mean and std, (n, q), of features (n, d)."""
        x = (features - self.x_scaling_.mean) / (self.x_scaling_.scale / self._input_factor())
        return self.head_.in_original_units(*self._add_standardised_outputs(x))

    def predict(self, X: Any, return_std: bool = False) -> Any:
        """Predict rows X (n, d).

        Returns: The mean (n,) or (n, q), as y in `fit`; with `return_std`, also the standard
        deviation of the same shape.
        """
        check_is_fitted(self)
        X = validate_data(self, X, reset=False, dtype=np.float64)
        found = self.head_.in_original_units(*self._outputs(self.x_scaling_.apply(X)))
        mean, std = (part[:, 0] if self.head_.one_output else part for part in found)
        return (mean, std) if return_std else mean

    def fitted_settings(self) -> str:
        """Size and chosen hyperparameters of the fitted regressor, for the model card."""
        return ""


@dataclass(frozen=True)
class FeatureSubset:
    """A regressor and the columns of the features (n, d) that it reads.

    Errors of estimates from different sensors are less correlated than those of different
    regressors of the same reading: fusing them reduces the error more.

    References: Comin and Saaj 2017, eqs. 18, 24 and 26.
    """

    name: str  # label in metrics, card and plots
    model: GaussianRegressor  # the regressor itself
    columns: tuple[int, ...] | None = None  # columns that it reads; None for all

    def select(self, features: Floats) -> Floats:
        """The columns (n, k) that the regressor reads."""
        return features if self.columns is None else features[:, list(self.columns)]

    def fit_left_out(
        self, features: Floats, targets: Floats, groups: Groups, progress: Progress, few: bool
    ) -> tuple[Floats, Floats]:
        """As `GaussianRegressor.fit_left_out`, on the columns that the regressor reads."""
        return self.model.fit_left_out(self.select(features), targets, groups, progress, few)

    def predict(self, features: Floats, return_std: bool = False) -> Any:
        """Mean (n, q); with `return_std` a tuple with the standard deviation."""
        return self.model.predict(self.select(features), return_std=return_std)

    def add_to_graph(self, features: Value) -> tuple[Value, Value]:
        """Add the regressor to an ONNX graph; mean and std, (n, q), of all features (n, d)."""
        if self.columns is not None:
            features = features.take(self.columns, axis=1)
        return self.model.add_to_graph(features)
