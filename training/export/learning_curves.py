"""The picture beside a file: error against the number of rows, or rows left out."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from sklearn.base import clone

from soilml.io.atomic_files import atomic_output
from soilml.optional_imports import load_matplotlib, quiet_matplotlib
from training.regressors.row_groups import folds_of
from training.train import TrainedModel

#: Shares of the rows that are not left out, at which the error is plotted.
SHARES = (0.01, 0.03, 0.1, 0.3, 1.0)
LEAST_ROWS = 40  # Fewest training rows of a point of the curve


def plot_learning_curves(trained: TrainedModel, path: str | os.PathLike[str]) -> None:
    """Error against rows, or for few rows their estimates against true values, as PNG."""
    load_matplotlib()
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6, 3.6), layout="constrained")
    axis = figure.subplots()
    (_plot_left_out if trained.left_out.few else _plot_rows)(axis, trained)
    with quiet_matplotlib(), atomic_output(path) as part:
        figure.savefig(part, format="png", dpi=110, metadata={"Software": "soilml"})


def _plot_rows(axis: Any, trained: TrainedModel) -> None:
    """Error on the runs of one fold against the number of other rows, where fits are fast."""
    data = trained.data
    out = folds_of(data.run) == 0
    rest = np.random.default_rng(0).permutation(np.flatnonzero(~out))
    for regressor in (member.regressor for member in trained.members):
        fixed = regressor.model.learning_curve_parameters()
        if fixed is None:
            continue
        sizes = [int(share * len(rest)) for share in SHARES if share * len(rest) >= LEAST_ROWS]
        errors = []
        for rows in (rest[:size] for size in sizes):
            model = clone(regressor.model).set_params(**fixed)
            model.fit(regressor.select(data.features[rows]), data.targets[rows])
            estimate = model.predict(regressor.select(data.features[out]))
            squared = ((data.targets[out] - estimate) / trained.prior.std) ** 2
            errors.append(float(np.sqrt(squared.mean(axis=0)).mean()))
        axis.plot(sizes, errors, "o-", label=regressor.name)
    for name, score in trained.scores.items():
        if "," not in name:
            axis.plot([len(data)], [score.relative.mean()], "_", ms=12, label=f"{name}, all rows")
    axis.set(xscale="log", xlabel="rows learned from", ylabel="RMSE / prior std, mean over outputs")
    axis.set_title("error on rows not learned from", fontsize=9)
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)


def _plot_left_out(axis: Any, trained: TrainedModel) -> None:
    """Estimates of a campaign of few rows by fits without their runs, against true values."""
    left = trained.left_out
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
