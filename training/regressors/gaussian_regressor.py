"""Base of the regressors: scikit-learn estimators of a mean and a variance, with ONNX export."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from training.onnx_graph.builder import Graph
from training.regressors.gaussian_head import GaussianHead
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]
#: Called with the steps done and the total number of steps.
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Requirements:
    """What a fit will take: the size of the model in words, and the memory in bytes."""

    size: str
    memory: int


class GaussianRegressor(MultiOutputMixin, RegressorMixin, BaseEstimator, ABC):  # type: ignore[misc]
    """Base of the regressors: mean and log-variance of standardised outputs.

    A subclass has a `type_name` for the spec, hyperparameters as keyword arguments of `__init__`,
    `fit`, which sets the attributes below, `_standardised_outputs` and `add_to_graph`.

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
    def fit(self, X: Any, y: Any) -> Self:
        """Fit rows X (n, d) to y (n,) or (n, q)."""

    @abstractmethod
    def _standardised_outputs(self, x: Floats) -> tuple[Floats, Floats]:
        """Mean and log-variance (n, q) of standardised outputs, from standardised inputs (n, d)."""

    @abstractmethod
    def add_to_graph(self, graph: Graph, features: str) -> tuple[str, str]:
        """Add the fitted regressor to an ONNX graph; names of mean and std, (n, q)."""

    def predict(self, X: Any, return_std: bool = False) -> Any:
        """Predict rows X (n, d).

        Returns
        -------
        mean : ndarray, shape (n,) or (n, q), as y in `fit`
        std : ndarray of the same shape
            Only with `return_std`.
        """
        check_is_fitted(self)
        X = validate_data(self, X, reset=False, dtype=np.float64)
        outputs = self._standardised_outputs(self.x_scaling_.apply(X))
        return self.head_.to_original_units(*outputs, return_std)

    def fit_with_validation(
        self, X: Floats, y: Floats, validation: tuple[Floats, Floats], progress: Progress
    ) -> Self:
        """Fit, where useful with validation rows (X, y) for early stopping; here without them."""
        return self.fit(X, y)

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
