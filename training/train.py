"""Train what a spec asks for, and measure it on rows that nobody learned from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.estimate import Together
from soilml.fusion import RULES
from training.calibrate import Calibrated, calibrated, covariances, together
from training.dataset import Dataset, Split, split
from training.fused import Fused, fused
from training.mlp import GaussianMLP
from training.score import Score, scored
from training.spec import Spec
from training.support import Support

Floats = NDArray[np.float64]
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Trained:
    """A trained estimator, everything its file needs, and its figures on unseen rows."""

    spec: Spec
    estimator: Calibrated
    support: Support
    together: Together
    prior_mean: Floats
    prior_std: Floats
    data: Dataset
    parts: Split
    scores: dict[str, Score]
    members: tuple[Calibrated, ...]

    def predict(self, features: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Mean, standard deviation (n, q) and in-range flag (n,), as the exported file gives them.

        Out of range it knows nothing, and answers with the prior.
        """
        mean, std = self.estimator.predict(features)
        inside = self.support.holds(features)
        return (
            np.where(inside[:, None], mean, self.prior_mean),
            np.where(inside[:, None], std, self.prior_std),
            inside,
        )


def train(
    spec: Spec, data: Dataset, progress: Progress = lambda text, done, total: None
) -> Trained:
    """Fit every regressor of the spec, recalibrate it, join them, and score the result.

    Held-out rows are cut in three: on the first, members are recalibrated and the correlation of
    their errors is measured; on the second, the joined estimate is recalibrated; on the third all
    figures are taken.
    """
    parts = split(data, spec.seed)
    prior_mean, prior_std = parts.train.targets.mean(axis=0), parts.train.targets.std(axis=0)
    first, second, third = _thirds(parts.calibrate.thinned(), spec.seed)
    members = []
    for regressor in spec.regressors:
        _fit(regressor, parts, partial(progress, f"fitting {regressor.kind}"))
        members.append(calibrated(regressor, first))
    scores = {m.regressor.kind: _scored(m, third, prior_std) for m in members}
    if len(members) > 1:
        for rule in RULES:
            joined = fused(members, rule, first)
            claimed = joined.predict(third.features)
            scores[f"{rule}, as claimed"] = scored(third.targets, *claimed, prior_std)
            widened = calibrated(joined, second)
            scores[f"{rule}, recalibrated"] = _scored(widened, third, prior_std)
        estimator = calibrated(fused(members, spec.rule, first), second)
    else:
        seen = parts.calibrate.thinned()
        estimator = calibrated(members[0].regressor, seen.rows(~np.isin(seen.run, third.run)))
    scores["estimator"] = _scored(estimator, third, prior_std)
    mean, std = estimator.predict(parts.calibrate.features)
    covariance = covariances(std, estimator.correlation)
    return Trained(
        spec=spec,
        estimator=estimator,
        support=Support.of(parts.train.features, spec.seed),
        together=together(mean, covariance, parts.calibrate, prior_mean, prior_std),
        prior_mean=prior_mean,
        prior_std=prior_std,
        data=data,
        parts=parts,
        scores=scores,
        members=tuple(members),
    )


def _fit(regressor: Any, parts: Split, progress: Callable[[int, int], None]) -> None:
    progress(0, 1)
    if isinstance(regressor, GaussianMLP):
        held_out = (parts.choose.features, parts.choose.targets)
        regressor.fit(
            parts.train.features,
            parts.train.targets,
            held_out=held_out,
            progress=lambda epoch: progress(epoch, regressor.epochs),
        )
    else:
        regressor.fit(parts.train.features, parts.train.targets)
    progress(1, 1)


def _thirds(data: Dataset, seed: int) -> tuple[Dataset, Dataset, Dataset]:
    """Three parts by run."""
    codes = np.unique(data.run)
    part = np.random.default_rng(seed + 1).permutation(len(codes)) % 3
    place = part[np.searchsorted(codes, data.run)]
    return data.rows(place == 0), data.rows(place == 1), data.rows(place == 2)


def _scored(estimator: Calibrated, data: Dataset, prior_std: Floats) -> Score:
    return scored(data.targets, *estimator.predict(data.features), prior_std)


__all__ = ["Fused", "Trained", "train"]
