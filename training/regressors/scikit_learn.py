"""Any regressor of scikit-learn, with a predictive variance and ONNX export by skl2onnx."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any, ClassVar

import numpy as np
from sklearn.base import BaseEstimator, clone, is_regressor

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.optional_imports import need
from training.onnx_graph.builder import OPSET, session_of
from training.onnx_graph.value import Value
from training.regressors.gaussian_regressor import GaussianRegressor, Groups, Progress, folds_of
from training.regressors.linear_gaussian import LinearGaussian

#: Largest difference of the graph from the regressor, in standard deviations of the outputs:
#: single precision has less, another function has more.
TOLERANCE = 1e-3
#: Rows on which the two are compared.
COMPARED = 500


class ScikitLearn(GaussianRegressor):
    """The mean of a regressor of scikit-learn, and a log-variance linear in X.

    Parameters
    ----------
    estimator : str or scikit-learn regressor
        One of several outputs. In a spec its class, such as "sklearn.ensemble.ExtraTreesRegressor".
    parameters : dict
        Its hyperparameters.

    Notes
    -----
    The log-variance is fitted to the squared residuals of rows that a fit has not seen.

    Raises `InputError` where the name is of no regressor of scikit-learn, where it refuses its
    parameters, and where skl2onnx cannot write it, or writes another function.

    Examples
    --------
    >>> from sklearn.neighbors import KNeighborsRegressor
    >>> x = np.linspace(0.0, 1.0, 50)[:, None]
    >>> near = ScikitLearn(KNeighborsRegressor(n_neighbors=1)).fit(x, 3.0 * x[:, 0])
    >>> print(near.predict([[0.5]]).round(1))
    [1.5]
    """

    type_name: ClassVar[str] = "scikit-learn"

    def __init__(
        self,
        estimator: Any = "sklearn.linear_model.Ridge",
        parameters: Mapping[str, Any] | None = None,
    ) -> None:
        self.estimator = estimator
        self.parameters = parameters

    def _fit_standardised(self, x: Floats, z: Floats, groups: Groups, progress: Progress) -> None:
        blank, fold, residual = self._blank(), folds_of(groups), np.empty_like(z)
        for k in range(count := int(fold.max()) + 1):
            progress(k, count + 1)
            out = fold == k
            residual[out] = z[out] - _mean(clone(blank).fit(x[~out], _targets(z[~out])), x[out])
        progress(count, count + 1)
        self.mean_ = clone(blank).fit(x, _targets(z))
        self.variance_ = LinearGaussian().fit_log_variance(x, residual)
        progress(count + 1, count + 1)

    def _standardised_outputs(self, x: Any) -> tuple[Any, Any]:
        return _mean(self.mean_, x), self.variance_.log_variance(x)

    def _add_standardised_outputs(self, x: Value) -> tuple[Value, Value]:
        need("skl2onnx", "train", "sklearn", what="a regressor of scikit-learn in a model file")
        from skl2onnx import to_onnx

        name, width = type(self.mean_).__name__, self.x_scaling_.mean.shape[0]
        probe = np.random.default_rng(0).standard_normal((COMPARED, width)).astype(np.float32)
        try:
            model = to_onnx(self.mean_, probe[:1], target_opset={"": OPSET, "ai.onnx.ml": 3})
            session = session_of(model)
            (found, *_) = session.run(None, {session.get_inputs()[0].name: probe})
            apart = np.abs(
                np.reshape(found, (COMPARED, -1)) - _mean(self.mean_, probe.astype(np.float64))
            )
        except Exception as error:  # of whatever kind: of the converter, or of onnxruntime
            first = str(error).strip().split("\n", 1)[0]
            raise InputError(f"{name} cannot be written as ONNX: skl2onnx says: {first}") from None
        # one row in a hundred may lie at an edge, where single precision takes the other side
        if not np.quantile(apart.max(axis=1), 0.99) <= TOLERANCE:
            raise InputError(
                f"{name}: what skl2onnx writes differs from it by {apart.max():.2g} standard "
                "deviations of the outputs; take another regressor, such as an ensemble of trees"
            )
        output = Value(x.graph, x.graph.inline(model, x.astype(np.float32).name))
        mean = output.astype(np.float64).reshape(-1, found.shape[-1])
        return mean, self.variance_.log_variance(x)

    def _blank(self) -> Any:
        """The regressor, not fitted."""
        given = dict(self.parameters or {})
        if isinstance(self.estimator, BaseEstimator):
            return clone(self.estimator).set_params(**given)
        module, _, name = str(self.estimator).rpartition(".")
        try:
            if module.split(".")[0] != "sklearn":
                raise ImportError
            found = getattr(import_module(module), name)(**given)
            if not is_regressor(found):
                raise TypeError("it is no regressor")
        except (ImportError, AttributeError):
            raise InputError(
                f"estimator is {self.estimator!r}; needed is a regressor of scikit-learn by its "
                "full name, such as 'sklearn.ensemble.ExtraTreesRegressor'"
            ) from None
        except (TypeError, ValueError) as error:
            raise InputError(f"estimator is {self.estimator!r}: {error}") from None
        return found

    def fitted_settings(self) -> str:
        """The regressor as scikit-learn prints it."""
        return " ".join(repr(self.mean_).split())


def _targets(z: Floats) -> Floats:
    """Outputs (n, q), or (n,) of one, as regressors of a single output want them."""
    return z[:, 0] if z.shape[1] == 1 else z


def _mean(fitted: Any, x: Floats) -> Floats:
    return np.asarray(fitted.predict(x), np.float64).reshape(len(x), -1)
