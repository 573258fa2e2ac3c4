"""The regressors with a predictive variance, as scikit-learn estimators.

They are those of `training.regressors`, loaded on first use; `predict(X, return_std=True)` gives
mean and standard deviation. They work in pipelines and searches of scikit-learn, and `soilml train`
calibrates and exports those that a spec names.

Examples
--------
>>> import numpy as np
>>> from soilml.regressors import LinearGaussian
>>> x = np.linspace(0.0, 1.0, 20)[:, None]
>>> mean, std = LinearGaussian().fit(x, 2.0 * x[:, 0]).predict(x, return_std=True)
>>> bool(np.allclose(mean, 2.0 * x[:, 0], atol=1e-3))
True
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOME = {
    "GaussianMLP": "training.regressors.gaussian_mlp",
    "GaussianRegressor": "training.regressors.gaussian_regressor",
    "LSSVM": "training.regressors.lssvm",
    "LinearGaussian": "training.regressors.linear_gaussian",
    "ScikitLearn": "training.regressors.scikit_learn",
}


def __getattr__(name: str) -> Any:
    if name == "__all__":
        return sorted(_HOME)
    if name not in _HOME:
        raise AttributeError(f"soilml.regressors has no {name!r}; there are: {', '.join(_HOME)}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(_HOME)
