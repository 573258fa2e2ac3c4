"""Base of the regressors: scikit-learn estimators of a mean and a variance, with ONNX export."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from soilml.arrays import Floats
from training.onnx_graph.builder import Graph
from training.regressors.standardisation import Standardisation

Progress = Callable[[int, int], None]

TAIL = 0.001  # Share of the training rows whose log-variances are clipped at either end


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

    def to_original_units(self, mean: Floats, log_variance: Floats, return_std: bool) -> Any:
        """Mean, or mean and standard deviation, (n,) or (n, q) as y was."""
        mean = self.scaling.undo(mean)
        std = np.exp(0.5 * np.clip(log_variance, self.low, self.high)) * self.scaling.scale
        if self.one_output:
            mean, std = mean[:, 0], std[:, 0]
        return (mean, std) if return_std else mean

    def add_to_graph(self, graph: Graph, mean: str, log_variance: str) -> tuple[str, str]:
        """Add the same conversion to an ONNX graph; names of mean and std, (n, q)."""
        scaled = graph.op("Mul", mean, graph.constant(self.scaling.scale))
        raised = graph.op("Max", log_variance, graph.constant(self.low))
        clipped = graph.op("Min", raised, graph.constant(self.high))
        std = graph.op("Exp", graph.op("Mul", clipped, graph.constant(np.float64(0.5))))
        return (
            graph.op("Add", scaled, graph.constant(self.scaling.mean)),
            graph.op("Mul", std, graph.constant(self.scaling.scale)),
        )


#: Called with the steps done and the total number of steps.


@dataclass(frozen=True)
class Requirements:
    """What a fit will take: the size of the model in words, and the memory in bytes."""

    size: str
    memory: int


class GaussianRegressor(MultiOutputMixin, RegressorMixin, BaseEstimator, ABC):  # type: ignore[misc]
    """Base of the regressors: mean and log-variance of standardised outputs.

    A subclass has a `type_name` for the spec, hyperparameters as keyword arguments of `__init__`,
    and the three abstract methods, which know standardised inputs (n, d) and outputs (n, q) alone.

    Attributes
    ----------
    x_scaling_, y_scaling_ : Standardisation
        Of the inputs (d,) and outputs (q,).
    head_ : GaussianHead
        From standardised outputs to mean and standard deviation.
    """

    type_name: ClassVar[str]
    #: Allowed values of hyperparameters that are words.
    choices: ClassVar[dict[str, tuple[str, ...]]] = {}

    x_scaling_: Standardisation
    y_scaling_: Standardisation
    head_: GaussianHead

    @abstractmethod
    def _fit_standardised(
        self, x: Floats, z: Floats, validation: tuple[Floats, Floats] | None, progress: Progress
    ) -> Floats:
        """Fit inputs x to outputs z; the log-variances (k, q) of training rows."""

    @abstractmethod
    def _standardised_outputs(self, x: Floats) -> tuple[Floats, Floats]:
        """Mean and log-variance (n, q)."""

    @abstractmethod
    def _add_standardised_outputs(self, graph: Graph, x: str) -> tuple[str, str]:
        """Add the same to an ONNX graph: names of mean and log-variance (n, q)."""

    def _set_aside(self, X: Floats, Y: Floats) -> tuple[Floats, Floats, Any]:
        """Training rows and validation rows of a fit without separate ones; here none."""
        return X, Y, None

    def _input_factor(self) -> float:
        """Factor on standardised inputs in the graph."""
        return 1.0

    def fit(self, X: Any, y: Any) -> Self:
        """Fit rows X (n, d) to y (n,) or (n, q)."""
        return self.fit_with_validation(X, y, None, lambda done, total: None)

    def fit_with_validation(
        self, X: Any, y: Any, validation: tuple[Floats, Floats] | None, progress: Progress
    ) -> Self:
        """Fit rows X (n, d) to y (n,) or (n, q), with validation rows (X, y) where that is useful.

        They select hyperparameters, or stop the training early.
        """
        rules = {"multi_output": True, "y_numeric": True, "ensure_min_samples": 2}
        X, y = validate_data(self, X, y, dtype=np.float64, **rules)
        Y = y.reshape(len(y), -1).astype(np.float64)
        if validation is None:
            X, Y, validation = self._set_aside(X, Y)
        self.x_scaling_, self.y_scaling_ = Standardisation.of(X), Standardisation.of(Y)
        x, z = self.x_scaling_.apply(X), self.y_scaling_.apply(Y)
        if validation is not None:
            truth = validation[1].reshape(len(validation[1]), -1)
            validation = (self.x_scaling_.apply(validation[0]), self.y_scaling_.apply(truth))
        log_variances = self._fit_standardised(x, z, validation, progress)
        self.head_ = GaussianHead.of(self.y_scaling_, log_variances, y.ndim == 1)
        return self

    def add_to_graph(self, graph: Graph, features: str) -> tuple[str, str]:
        """Add the fitted regressor to an ONNX graph; names of mean and std, (n, q)."""
        scale = self.x_scaling_.scale / self._input_factor()
        x = graph.scaled(features, self.x_scaling_.mean, scale)
        return self.head_.add_to_graph(graph, *self._add_standardised_outputs(graph, x))

    def predict(self, X: Any, return_std: bool = False) -> Any:
        """Predict rows X (n, d).

        Returns: The mean (n,) or (n, q), as y in `fit`; with `return_std`, also the standard
        deviation of the same shape.
        """
        check_is_fitted(self)
        X = validate_data(self, X, reset=False, dtype=np.float64)
        outputs = self._standardised_outputs(self.x_scaling_.apply(X))
        return self.head_.to_original_units(*outputs, return_std)

    def requirements(self, rows: int, inputs: int, outputs: int) -> Requirements | None:
        """What a fit to so many rows takes; None where that is little."""
        return None

    def fitted_settings(self) -> str:
        """Size and chosen hyperparameters of the fitted regressor, for the model card."""
        return ""

    def learning_curve_parameters(self) -> dict[str, Any] | None:
        """Hyperparameters that stay fixed when it is fitted again to fewer rows.

        None where fitting again takes too long for a learning curve.
        """
        return {}

    def hyperparameter_search(self) -> list[tuple[float, Floats, Floats]]:
        """Kernel width, gammas and held-out errors of each width; the selected one is the last."""
        return []

    def mean_only_epochs(self) -> int:
        """Number of first epochs in which only the mean is fitted, with another loss."""
        return 0

    def loss_history(self) -> list[tuple[float, float]]:
        """Training and validation loss of each epoch, of a regressor that is fitted by epochs."""
        return []


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

    def fit(
        self, training: tuple[Floats, Floats], validation: tuple[Floats, Floats], progress: Progress
    ) -> None:
        """Fit the regressor to features and targets, with others for early stopping."""
        subset = (self.select(validation[0]), validation[1])
        self.model.fit_with_validation(self.select(training[0]), training[1], subset, progress)

    def predict(self, features: Floats, return_std: bool = False) -> Any:
        """Mean (n, q); with `return_std` a tuple with the standard deviation."""
        return self.model.predict(self.select(features), return_std=return_std)

    def add_to_graph(self, graph: Graph, features: str) -> tuple[str, str]:
        """Add the regressor to an ONNX graph; names of mean and std, (n, q)."""
        if self.columns is not None:
            columns = graph.constant(np.asarray(self.columns, dtype=np.int64))
            features = graph.op("Gather", features, columns, axis=1)
        return self.model.add_to_graph(graph, features)
