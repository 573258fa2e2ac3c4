"""Train what a spec asks for, and measure it on rows that nobody learned from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from datagen.recipe import parse_recipe
from soilml.errors import InputError
from soilml.numerics.estimate_fusion import RULES
from soilml.onboard.estimate import (
    PoolingCalibration,
    PoolingRule,
    PriorSummary,
    RunConditions,
    pooled_within_prior,
)
from training.calibration.recalibration import (
    LEAST_GROUPS,
    CalibratedRegressor,
    covariances,
    groups_of,
    long_groups,
    measured_of,
    pooling_calibration,
    recalibrate,
    run_conditions_of,
    runs_that,
    without_pooling,
)
from training.calibration.scores import NINETY, Score, scored
from training.calibration.training_domain import TrainingDomain
from training.data.dataset import Dataset, Split, split
from training.ensemble import Ensemble, fuse_members
from training.regressors.feature_subset import FeatureSubset
from training.regressors.gaussian_mlp import GaussianMLP
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.recipe_family import RecipeFamily
from training.set_posterior.response_surface import fit_response
from training.set_posterior.validation import (
    SetFigures,
    calibrate_misfit_limits,
    validate_posterior,
)
from training.spec import Spec

Floats = NDArray[np.float64]
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Trained:
    """A trained estimator, everything its file needs, and its figures on unseen rows."""

    spec: Spec
    estimator: CalibratedRegressor
    support: TrainingDomain
    together: PoolingCalibration
    prior: PriorSummary
    data: Dataset
    parts: Split
    scores: dict[str, Score]
    sets: dict[str, dict[int, Score]]
    members: tuple[CalibratedRegressor, ...]
    posterior: SetPosteriorGraph | None = None
    figures: dict[int, SetFigures] = field(default_factory=dict)

    def predict(self, features: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Mean, standard deviation (n, q) and in-range flag (n,), as the exported file gives them.

        Out of range it knows nothing, and answers with the prior.
        """
        mean, std = self.estimator.predict(features)
        inside = self.support.holds(features)
        kept = np.clip(mean, self.prior.lower, self.prior.upper)
        return (
            np.where(inside[:, None], kept, self.prior.mean),
            np.where(inside[:, None], std, self.prior.std),
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
    targets = parts.train.targets
    prior = PriorSummary(targets.mean(axis=0), targets.std(axis=0), data.lower, data.upper)
    first, second, third = _thirds(parts.calibrate.thinned(), spec.seed)
    unseen = np.isin(parts.calibrate.run, third.run)
    _check_enough(data, parts.calibrate.rows(~unseen))
    members = []
    for regressor in spec.regressors:
        _fit(regressor, parts, partial(progress, f"fitting {regressor.kind}"))
        members.append(recalibrate(regressor, first))
    scores = {m.regressor.kind: _scored(m, third, prior.std) for m in members}
    if len(members) > 1:
        for rule in RULES:
            joined = fuse_members(members, rule, first)
            claimed = joined.predict(third.features)
            scores[f"{rule}, as claimed"] = scored(third.targets, *claimed, prior.std)
            widened = recalibrate(joined, second)
            scores[f"{rule}, recalibrated"] = _scored(widened, third, prior.std)
        estimator = recalibrate(fuse_members(members, spec.rule, first), second)
    else:
        seen = parts.calibrate.thinned()
        estimator = recalibrate(members[0].regressor, seen.rows(~np.isin(seen.run, third.run)))
    scores["estimator"] = _scored(estimator, third, prior.std)
    joint = _together(
        estimator,
        parts.calibrate.rows(~unseen),
        prior,
        run_conditions_of(parts.train),
        spec.per_row,
    )
    posterior, figures = None, {}
    if spec.set_posterior is not None:
        family = RecipeFamily.of(parse_recipe(data.recipe, "recipe of the data"), spec.targets)
        posterior = calibrate_misfit_limits(
            family, fit_response(family, spec.set_posterior, progress), progress
        )
        figures = validate_posterior(posterior, progress)
    return Trained(
        spec=spec,
        estimator=estimator,
        support=TrainingDomain.of(parts.train.features, spec.features, spec.seed),
        together=joint,
        prior=prior,
        data=data,
        parts=parts,
        scores=scores,
        sets=_set_scores(estimator, joint, parts.calibrate.rows(unseen), prior),
        members=tuple(members),
        posterior=posterior,
        figures=figures,
    )


def _check_enough(data: Dataset, calibrate: Dataset) -> None:
    """Raise `InputError` where intervals would be measured on too few rows."""
    found = len(groups_of(calibrate.runs(), 1))
    if found < LEAST_GROUPS:
        needed = int(1.1 * len(data) * LEAST_GROUPS / max(found, 1)) + 1
        raise InputError(
            f"{len(data)} rows leave {found} to measure the intervals on; needed are "
            f"{LEAST_GROUPS}: generate about {needed} rows of such runs, or more"
        )


def _fit(reader: FeatureSubset, parts: Split, progress: Callable[[int, int], None]) -> None:
    progress(0, 1)
    machine, shown = reader.machine, reader.read(parts.train.features)
    if isinstance(machine, GaussianMLP):
        held_out = (reader.read(parts.choose.features), parts.choose.targets)
        machine.fit(
            shown,
            parts.train.targets,
            held_out=held_out,
            progress=lambda epoch: progress(epoch, machine.epochs),
        )
    else:
        machine.fit(shown, parts.train.targets)
    if not np.isfinite(reader.predict(parts.choose.features)).all():
        raise InputError(f"{reader.kind} did not converge: change its settings in the spec")
    progress(1, 1)


def _thirds(data: Dataset, seed: int) -> tuple[Dataset, Dataset, Dataset]:
    """Three parts by run."""
    codes = np.unique(data.run)
    part = np.random.default_rng(seed + 1).permutation(len(codes)) % 3
    place = part[np.searchsorted(codes, data.run)]
    return data.rows(place == 0), data.rows(place == 1), data.rows(place == 2)


def _together(
    estimator: CalibratedRegressor,
    data: Dataset,
    prior: PriorSummary,
    driven: RunConditions,
    per_row: bool,
) -> PoolingCalibration:
    """What joining rows takes; where they have no one value, the interval of one row alone."""
    mean, std = estimator.predict(data.features)
    covariance = covariances(std, estimator.correlation)
    return (without_pooling if per_row else pooling_calibration)(
        mean, covariance, data, prior, driven
    )


def _set_scores(
    estimator: CalibratedRegressor, joint: PoolingCalibration, data: Dataset, prior: PriorSummary
) -> dict[str, dict[int, Score]]:
    """Figures of several rows joined, by what the run varied and the number of rows.

    On runs that joining was not fitted to.
    """
    mean, std = estimator.predict(data.features)
    covariance = covariances(std, estimator.correlation)
    found: dict[str, dict[int, Score]] = {}
    for kind in joint.kinds:
        scores = found[joint.said(kind)] = {}
        for groups in long_groups(runs_that(kind.varies, data, joint.driven)):
            answers = [
                _joined(mean[rows], covariance[rows], prior, joint.rule(measured_of(data, rows)))
                for rows in groups
            ]
            middle, spread = (np.stack(part) for part in zip(*answers, strict=True))
            scores[groups.shape[1]] = scored(data.targets[groups[:, 0]], middle, spread, prior.std)
    return found


def _joined(
    mean: Floats, covariance: Floats, prior: PriorSummary, rule: PoolingRule
) -> tuple[Floats, Floats]:
    """Mean, and the standard deviation of a Gaussian with the interval that is answered."""
    joint = pooled_within_prior(mean, covariance, prior, rule)
    return joint.mean, np.sqrt(np.diag(joint.covariance)) * rule.reach / NINETY


def _scored(estimator: CalibratedRegressor, data: Dataset, prior_std: Floats) -> Score:
    return scored(data.targets, *estimator.predict(data.features), prior_std)


__all__ = ["Ensemble", "Trained", "train"]
