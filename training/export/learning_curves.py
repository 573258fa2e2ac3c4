"""Plots of how the regressors were fitted: learning curves, searches and losses."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np
from sklearn.base import clone

from soilml.io.atomic_files import atomic_output
from soilml.optional_imports import load_matplotlib, quiet_matplotlib
from training.regressors.gaussian_regressor import FeatureSubset
from training.train import TrainedModel

#: Shares of the training rows at which the validation error is plotted.
SHARES = (0.01, 0.03, 0.1, 0.3, 1.0)
LEAST_ROWS = 40  # Fewest training rows of a point of the curve


def plot_learning_curves(trained: TrainedModel, path: str | os.PathLike[str]) -> None:
    """Error against rows, loss against epochs, and held-out error against gamma, as PNG."""
    load_matplotlib()
    from matplotlib.figure import Figure

    regressors = [member.regressor for member in trained.members]
    searched = [r for r in regressors if r.model.hyperparameter_search()]
    by_epochs = [r for r in regressors if r.model.loss_history()]
    count = 1 + len(searched) + len(by_epochs)
    figure = Figure(figsize=(4.2 * count, 3.6), layout="constrained")
    axes = figure.subplots(1, count, squeeze=False)[0]
    if trained.left_out is None:
        _plot_rows(axes[0], trained, regressors)
    else:
        _plot_left_out(axes[0], trained)
    for axis, regressor in zip(axes[1:], searched, strict=False):
        _plot_search(axis, regressor)
    for axis, regressor in zip(axes[1 + len(searched) :], by_epochs, strict=True):
        _plot_epochs(axis, regressor)
    with quiet_matplotlib(), atomic_output(path) as part:
        figure.savefig(part, format="png", dpi=110, metadata={"Software": "soilml"})


def _plot_rows(axis: Any, trained: TrainedModel, regressors: list[FeatureSubset]) -> None:
    """Validation error against the number of training rows, of regressors that are fast to fit."""
    train = trained.parts.train
    for regressor in regressors:
        features = regressor.select(train.features)
        fixed = regressor.model.learning_curve_parameters()
        if fixed is None:
            error = _relative_rmse(regressor, trained)
            axis.plot([len(train)], [error], "o", label=regressor.name)
            continue
        sizes, errors = [], []
        for share in SHARES:
            size = int(share * len(train))
            if size < LEAST_ROWS:
                continue
            refitted = regressor.model
            if size < len(train):
                refitted = clone(regressor.model).set_params(**fixed)
                refitted.fit(features[:size], train.targets[:size])
            sizes.append(size)
            errors.append(_relative_rmse(replace(regressor, model=refitted), trained))
        axis.plot(sizes, errors, "o-", label=regressor.name)
    axis.set(xscale="log", xlabel="rows learned from", ylabel="RMSE / prior std, mean over outputs")
    count = len(trained.parts.validation)
    axis.set_title(f"error on {count} rows not learned from", fontsize=9)
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)


def _plot_left_out(axis: Any, trained: TrainedModel) -> None:
    """Estimates of a campaign of few rows by fits without their runs, against true values."""
    left = trained.left_out
    assert left is not None
    lower, width = trained.prior.lower, trained.prior.upper - trained.prior.lower
    mean = np.clip(left.mean, lower, trained.prior.upper)
    for k, name in enumerate(trained.spec.targets):
        middle, half = (
            (mean[:, k] - lower[k]) / width[k],
            left.factor[k] * left.std[:, k] / width[k],
        )
        axis.errorbar(
            (trained.data.targets[:, k] - lower[k]) / width[k],
            middle,
            np.minimum([half, half], [middle, 1.0 - middle]),  # intervals end with the prior
            fmt="o",
            ms=3,
            lw=0.6,
            alpha=0.7,
            label=name.replace("_", " "),
        )
    axis.plot([0.0, 1.0], [0.0, 1.0], "k:", lw=0.8)
    axis.set(xlabel="true value, share of the prior's range", ylabel="estimate, same share")
    axis.set_title(f"{len(mean)} rows, each left out; bars: 90 % intervals", fontsize=9)
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)


def _relative_rmse(regressor: FeatureSubset, trained: TrainedModel) -> float:
    """RMSE on the validation rows in prior standard deviations, averaged over the targets."""
    validation = trained.parts.validation
    error = (validation.targets - regressor.predict(validation.features)) / trained.prior.std
    return float(np.sqrt(np.mean(error**2, axis=0)).mean())


def _plot_search(axis: Any, regressor: FeatureSubset) -> None:
    """Held-out error against gamma for each width, and the selected pair."""
    search = regressor.model.hyperparameter_search()
    for width, gammas, errors in search:
        axis.plot(gammas, np.sqrt(errors), "-", label=f"width {width:.2g}")
    _, gammas, errors = search[-1]
    axis.plot([gammas[int(np.argmin(errors))]], [np.sqrt(errors.min())], "k*", ms=10)
    axis.set(xscale="log", xlabel="gamma", ylabel="held-out error / spread of outputs")
    axis.set_title(f"{regressor.name}: choice of gamma and width", fontsize=9)
    low = float(np.sqrt(errors.min()))
    axis.set_ylim(low * 0.995, low * 1.08)
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)


def _plot_epochs(axis: Any, regressor: FeatureSubset) -> None:
    """Training and validation loss against epochs, without those of the mean alone."""
    loss = np.asarray(regressor.model.loss_history())
    first = regressor.model.mean_only_epochs()
    epochs = np.arange(1, len(loss) + 1)
    axis.plot(epochs[first:], loss[first:, 0], label="learned from")
    axis.plot(epochs[first:], loss[first:, 1], label="held out")
    best = first + int(np.argmin(loss[first:, 1])) if len(loss) > first else len(loss) - 1
    axis.axvline(epochs[best], color="k", lw=0.8, ls=":", label=f"kept: epoch {epochs[best]}")
    axis.set(xlabel="epoch", ylabel="negative log likelihood, nat")
    axis.set_title(f"{regressor.name}: likelihood (mean-only epochs left out)", fontsize=9)
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)
