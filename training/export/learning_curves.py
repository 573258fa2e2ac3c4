"""Learning curves as a picture."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np
from sklearn.base import clone

from soilml.io.atomic_files import atomic_output
from training.regressors.feature_subset import FeatureSubset
from training.regressors.fixed_size_lssvm import FixedSizeLSSVM
from training.regressors.gaussian_mlp import GaussianMLP
from training.regressors.lssvm import LSSVM
from training.train import Trained

#: Shares of the training rows at which the error is looked at.
SHARES = (0.01, 0.03, 0.1, 0.3, 1.0)


def draw_curves(trained: Trained, path: str | os.PathLike[str]) -> None:
    """Error against rows, loss against epochs, and leave-one-out error against gamma, as PNG."""
    from matplotlib.figure import Figure

    readers = [member.regressor for member in trained.members]
    searched = [r for r in readers if isinstance(r.machine, LSSVM | FixedSizeLSSVM)]
    learned = [r for r in readers if isinstance(r.machine, GaussianMLP)]
    figure = Figure(figsize=(4.2 * (1 + len(searched) + len(learned)), 3.6), layout="constrained")
    axes = figure.subplots(1, 1 + len(searched) + len(learned), squeeze=False)[0]
    _rows(axes[0], trained, readers)
    for axis, reader in zip(axes[1:], [*searched, *learned], strict=True):
        if isinstance(reader.machine, GaussianMLP):
            _epochs(axis, reader)
        else:
            _search(axis, reader)
    with atomic_output(path) as part:
        figure.savefig(part, format="png", dpi=110, metadata={"Software": "soilml"})


def _rows(axis: Any, trained: Trained, readers: list[FeatureSubset]) -> None:
    """Error on held-out rows against rows learned from, for the machines that fit in a moment."""
    train, check = trained.parts.train, trained.parts.choose
    for reader in readers:
        machine, shown = reader.machine, reader.read(train.features)
        if isinstance(machine, GaussianMLP | LSSVM):
            error = _relative(reader, trained)
            axis.plot([len(train)], [error], "o", label=reader.kind)
            continue
        fixed: dict[str, Any] = {}
        if isinstance(machine, FixedSizeLSSVM):
            fixed = {"gamma": machine.gamma_, "width": machine.width_}
        sizes, errors = [], []
        for share in SHARES:
            size = int(share * len(train))
            if size < 40:
                continue
            some = clone(machine).set_params(**fixed).fit(shown[:size], train.targets[:size])
            sizes.append(size)
            errors.append(_relative(replace(reader, machine=some), trained))
        axis.plot(sizes, errors, "o-", label=reader.kind)
    axis.set(xscale="log", xlabel="rows learned from", ylabel="RMSE / prior std, mean over outputs")
    axis.set_title(f"error on {len(check)} rows not learned from", fontsize=9)
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)


def _relative(reader: FeatureSubset, trained: Trained) -> float:
    check = trained.parts.choose
    error = (check.targets - reader.predict(check.features)) / trained.prior.std
    return float(np.sqrt(np.mean(error**2, axis=0)).mean())


def _search(axis: Any, reader: FeatureSubset) -> None:
    machine = reader.machine
    for width, gammas, errors in machine.search_:
        axis.plot(gammas, np.sqrt(errors), "-", label=f"width {width:.2g}")
    axis.plot([machine.gamma_], [min(np.sqrt(e.min()) for _, _, e in machine.search_)], "k*", ms=10)
    axis.set(xscale="log", xlabel="gamma", ylabel="leave-one-out error / spread of outputs")
    axis.set_title(f"{reader.kind}: choice by leave-one-out", fontsize=9)
    low = min(float(np.sqrt(e.min())) for _, _, e in machine.search_)
    axis.set_ylim(low * 0.995, low * 1.08)
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)


def _epochs(axis: Any, reader: FeatureSubset) -> None:
    machine = reader.machine
    loss = np.asarray(machine.history_)
    held = int(np.ceil(machine.warm_up * machine.epochs))
    epochs = np.arange(1, len(loss) + 1)
    axis.plot(epochs[held:], loss[held:, 0], label="learned from")
    axis.plot(epochs[held:], loss[held:, 1], label="held out")
    best = held + int(np.argmin(loss[held:, 1])) if len(loss) > held else len(loss) - 1
    axis.axvline(epochs[best], color="k", lw=0.8, ls=":", label=f"kept: epoch {epochs[best]}")
    axis.set(xlabel="epoch", ylabel="negative log likelihood, nat")
    axis.set_title(f"{reader.kind}: likelihood (mean-only epochs left out)", fontsize=9)
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)
