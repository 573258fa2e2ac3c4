"""Training: fit, recalibrate and fuse the regressors of a spec, and measure them on unseen rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from datagen.recipe import parse_recipe
from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.onboard.estimate import PriorSummary
from soilml.onboard.fusion_rules import RULES
from soilml.onboard.gaussian_pooling import PoolingCalibration, pool_within_prior
from soilml.quantities import Z_90
from training.available_memory import available_memory
from training.calibration.held_out import carry_errors, measure_held_out
from training.calibration.recalibration import (
    CalibratedRegressor,
    Metrics,
    compute_metrics,
    covariance_matrices,
    recalibrate,
)
from training.calibration.row_pooling import (
    LEAST_GROUPS,
    calibrate_pooling,
    calibrate_single_rows,
    groups_by_length,
    measured_rows,
    row_groups,
    run_conditions,
    runs_with_pattern,
)
from training.calibration.training_domain import TrainingDomain
from training.dataset import Dataset, DataSplit, split_by_run
from training.ensemble import fuse_members
from training.few_rows import LeftOut, fit_few_rows
from training.regressors.gaussian_regressor import FeatureSubset
from training.set_posterior.families.recipe_family import RecipeFamily
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.response_surface import fit_response
from training.set_posterior.validation import (
    SetFigures,
    calibrate_misfit_limits,
    validate_posterior,
)
from training.spec import AnyWheelSpec, Spec

Progress = Callable[[str, int, int], None]

#: Called with the name of a stage, the steps done and the total number of steps.
#: A set posterior and its metrics by number of rows.
TrainedSetPosterior = tuple[SetPosteriorGraph, dict[int, SetFigures]]


@dataclass(frozen=True)
class TrainedModel:
    """A trained model, what its file needs, and its metrics on unseen rows."""

    spec: Spec  # what it was trained from
    estimator: CalibratedRegressor  # the only regressor, or the ensemble of all
    domain: TrainingDomain  # where estimates are in range
    #: calibration of single rows, and of several rows of one soil that are pooled as
    #: Gaussians; rows are not pooled where they have targets of their own, or a set posterior
    pooling: PoolingCalibration
    prior: PriorSummary  # prior of the targets
    data: Dataset
    parts: DataSplit
    #: of single rows: of each member, of each fusion rule, and of the estimator
    scores: dict[str, Metrics]
    #: of pooled rows, by pattern of operating conditions and number of rows
    pooled_scores: dict[str, dict[int, Metrics]]
    members: tuple[CalibratedRegressor, ...]  # the single regressors
    #: of repeated readings at one slip, by their number, for targets that differ between rows
    repeat_scores: dict[int, Metrics] = field(default_factory=dict)
    #: posterior of several rows, where the spec asks for it
    set_posterior: SetPosteriorGraph | None = None
    #: its metrics by number of rows
    set_figures: dict[int, SetFigures] = field(default_factory=dict)
    #: of a campaign of few rows: estimates of all rows by fits that have not seen their runs
    left_out: LeftOut | None = None

    def predict(self, features: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Mean, standard deviation (n, q) and in-range flag (n,), as in the exported file.

        Out of range, mean and standard deviation are those of the prior.
        """
        mean, std = self.estimator.predict(features)
        inside = self.domain.contains(features)
        clipped = np.clip(mean, self.prior.lower, self.prior.upper)
        return (
            np.where(inside[:, None], clipped, self.prior.mean),
            np.where(inside[:, None], std, self.prior.std),
            inside,
        )


def train(
    spec: Spec, data: Dataset, progress: Progress = lambda text, done, total: None
) -> TrainedModel:
    """Fit and recalibrate every regressor of a spec, fuse them, and measure the result.

    The calibration rows are cut in three by run. On the first part the members are recalibrated and
    the correlation of their errors is measured; on the second the fused estimate is recalibrated;
    on the third all metrics are measured. Where they are too few for that, each row is judged by a
    fit to the other runs instead (`training.few_rows`).

    Parameters
    ----------
    spec : Spec
        From `read_spec`; its regressors are fitted in place.
    data : Dataset
        From `read_dataset`, with the features and targets of the spec.
    progress : callable
        Called with the name of a stage, the steps done and the total number of steps.

    Returns
    -------
    TrainedModel

    Raises
    ------
    InputError
        Where a regressor does not converge, or needs more memory than is free.

    Examples
    --------
    >>> from training.dataset import read_dataset
    >>> from training.spec import read_spec
    >>> spec = read_spec("linear")
    >>> data = read_dataset("data.parquet", spec.features, spec.targets)  # doctest: +SKIP
    >>> train(spec, data).scores["estimator"].relative  # doctest: +SKIP
    array([0.943, 0.881, 0.688])
    """
    parts = split_by_run(data, spec.seed)
    first, second, third = _split_in_three(parts.calibration.limit_rows_per_run(), spec.seed)
    scored = np.isin(parts.calibration.run, third.run)
    calibration = parts.calibration.rows(~scored)
    if len(row_groups(calibration.runs(), 1)) < LEAST_GROUPS:
        return _train_on_few_rows(spec, data, progress)
    prior = _prior(parts.train)
    labels = [_label(regressor, parts) for regressor in spec.regressors]
    # first, because it refuses loads that the soils do not carry
    set_posterior, set_figures = _train_set_posterior(spec, data, progress)
    members = []
    for regressor, label in zip(spec.regressors, labels, strict=True):
        _fit(regressor, parts, partial(progress, f"fitting {label}"))
        members.append(recalibrate(regressor, first))
    scores = {m.regressor.name: score(m, third, prior.std) for m in members}
    if len(members) > 1:
        scores |= score_rules(members, first, second, third, prior.std)
        estimator = recalibrate(fuse_members(members, spec.rule, first), second)
    else:
        estimator = recalibrate(members[0].regressor, _unscored_rows(parts, third))
    scores["estimator"] = score(estimator, third, prior.std)
    mean, std = estimator.predict(calibration.features)
    covariance = covariance_matrices(std, estimator.correlation)
    alone = spec.per_row or spec.set_posterior is not None  # rows are not pooled as Gaussians
    calibrate = calibrate_single_rows if alone else calibrate_pooling
    pooling = calibrate(mean, covariance, calibration, prior, run_conditions(parts.train))
    trained = TrainedModel(
        spec=spec,
        estimator=estimator,
        domain=TrainingDomain.of(parts.train.features, spec.features, spec.seed),
        pooling=pooling,
        prior=prior,
        data=data,
        parts=parts,
        scores=scores,
        pooled_scores=score_pooling(estimator, pooling, parts.calibration.rows(scored), prior),
        members=tuple(members),
        set_posterior=set_posterior,
        set_figures=set_figures,
    )
    if spec.per_row:
        pooling, repeats = carry_errors(
            trained.predict, pooling, calibration, parts.calibration.rows(scored), prior.std
        )
        trained = replace(trained, pooling=pooling, repeat_scores=repeats)
    return trained


def train_any_wheel(spec: AnyWheelSpec, progress: Progress) -> TrainedSetPosterior:
    """The set posterior of wheels of any size, and its metrics on fresh simulated sets."""
    response = fit_response(spec.family, spec.response, progress)
    posterior = calibrate_misfit_limits(spec.family, response, progress, spec.response.small)
    posterior = replace(
        posterior, scales=spec.response.scales, sensor_errors=spec.response.sensor_errors
    )
    return posterior, validate_posterior(posterior, progress)


def _train_set_posterior(
    spec: Spec, data: Dataset, progress: Progress
) -> tuple[SetPosteriorGraph | None, dict[int, SetFigures]]:
    if spec.set_posterior is None:
        return None, {}
    family = RecipeFamily.of(parse_recipe(data.recipe, "recipe of the data"), spec.targets)
    response = fit_response(family, spec.set_posterior, progress)
    posterior = calibrate_misfit_limits(family, response, progress, spec.set_posterior.small)
    posterior = replace(
        posterior,
        noise=family.declared_noise(),
        scales=spec.set_posterior.scales,
        sensor_errors=spec.set_posterior.sensor_errors,
    )
    return posterior, validate_posterior(posterior, progress)


def _train_on_few_rows(spec: Spec, data: Dataset, progress: Progress) -> TrainedModel:
    """The same where too few rows remain to calibrate on: all are learned from, and left out."""
    parts, prior = DataSplit(data, data, data), _prior(data)
    for regressor in spec.regressors:
        _label(regressor, parts)  # refuses what does not fit into memory
    set_posterior, set_figures = _train_set_posterior(spec, data, progress)
    estimator, members, left = fit_few_rows(
        spec.regressors, spec.rule, data, prior, spec.seed, progress
    )
    last, conditions = left[-1], run_conditions(data)
    alone = spec.per_row or spec.set_posterior is not None
    covariance = covariance_matrices(last.std, estimator.correlation)
    calibrate = calibrate_single_rows if alone else calibrate_pooling
    pooling = replace(
        calibrate(last.mean, covariance, data, prior, conditions),
        single_row_coverage_factor=last.factor,
    )
    if spec.per_row:
        clipped = np.clip(last.mean, prior.lower, prior.upper)
        answers = (clipped, last.std, np.ones(len(data), bool))
        single = replace(data, run=np.arange(len(data)))  # few rows: all are carried
        held_out = measure_held_out(lambda features: answers, single, conditions, last.factor)
        pooling = replace(pooling, held_out=held_out)
    names = [*(regressor.name for regressor in spec.regressors), "estimator"]
    return TrainedModel(
        spec=spec,
        estimator=estimator,
        domain=TrainingDomain.of(data.features, spec.features, spec.seed, few=True),
        pooling=pooling,
        prior=prior,
        data=data,
        parts=parts,
        scores={
            name: compute_metrics(data.targets, part.mean, part.std, prior.std)
            for name, part in zip(names, [*left[: len(members)], last], strict=True)
        },
        pooled_scores={},
        members=tuple(members),
        set_posterior=set_posterior,
        set_figures=set_figures,
        left_out=last,
    )


def _prior(data: Dataset) -> PriorSummary:
    """Mean and spread of the targets in the training rows, within the range of the recipe."""
    return PriorSummary(data.targets.mean(axis=0), data.targets.std(axis=0), data.lower, data.upper)


def _label(regressor: FeatureSubset, parts: DataSplit) -> str:
    """Name of a regressor with what its fit will take; raises `InputError` where it does not fit.

    It is said and refused before anything is fitted.
    """
    rows, outputs = parts.train.targets.shape
    inputs = regressor.select(parts.train.features[:1]).shape[1]
    needs = regressor.model.requirements(rows, inputs, outputs)
    if needs is None:
        return regressor.name
    free = available_memory()
    size = f"{rows} rows, {needs.size}, {needs.memory / 1e9:.2g} GB of memory"
    if free is not None and needs.memory > free:
        raise InputError(
            f"{regressor.name}: {size}, and {free / 1e9:.2g} GB are free; take fewer rows, or "
            'fewer prototypes with solution = "fixed-size"'
        )
    return f"{regressor.name} ({size})"


def _fit(regressor: FeatureSubset, parts: DataSplit, progress: Callable[[int, int], None]) -> None:
    progress(0, 1)
    training = (parts.train.features, parts.train.targets)
    validation = (parts.validation.features, parts.validation.targets)
    regressor.fit(training, validation, progress)
    if not np.isfinite(regressor.predict(parts.validation.features)).all():
        raise InputError(f"{regressor.name} did not converge: change its settings in the spec")
    progress(1, 1)


def _split_in_three(data: Dataset, seed: int) -> tuple[Dataset, Dataset, Dataset]:
    """Three parts of about equal size, by run."""
    codes = np.unique(data.run)
    part_of_run = np.random.default_rng(seed + 1).permutation(len(codes)) % 3
    part = part_of_run[np.searchsorted(codes, data.run)]
    return data.rows(part == 0), data.rows(part == 1), data.rows(part == 2)


def _unscored_rows(parts: DataSplit, scored: Dataset) -> Dataset:
    """Calibration rows, a few of each run, without the runs that metrics are measured on."""
    few = parts.calibration.limit_rows_per_run()
    return few.rows(~np.isin(few.run, scored.run))


def score(estimator: CalibratedRegressor, data: Dataset, prior_std: Floats) -> Metrics:
    """Metrics of single rows."""
    return compute_metrics(data.targets, *estimator.predict(data.features), prior_std)


def score_rules(
    members: list[CalibratedRegressor],
    first: Dataset,
    second: Dataset,
    third: Dataset,
    prior_std: Floats,
) -> dict[str, Metrics]:
    """Metrics of every fusion rule, before and after recalibration."""
    scores = {}
    for rule in RULES:
        ensemble = fuse_members(members, rule, first)
        claimed = ensemble.predict(third.features)
        scores[f"{rule}, as claimed"] = compute_metrics(third.targets, *claimed, prior_std)
        scores[f"{rule}, recalibrated"] = score(recalibrate(ensemble, second), third, prior_std)
    return scores


def score_pooling(
    estimator: CalibratedRegressor, pooling: PoolingCalibration, data: Dataset, prior: PriorSummary
) -> dict[str, dict[int, Metrics]]:
    """Metrics of pooled rows by pattern and number of rows, on runs not used for calibration."""
    mean, std = estimator.predict(data.features)
    covariance = covariance_matrices(std, estimator.correlation)
    scores: dict[str, dict[int, Metrics]] = {}
    for pattern in pooling.patterns:
        by_length = scores[pooling.label(pattern)] = {}
        runs = runs_with_pattern(pattern.varies, data, pooling.conditions)
        for groups in groups_by_length(runs):
            rule = pooling.rule(measured_rows(data, groups))
            pooled = pool_within_prior(mean[groups], covariance[groups], prior, rule)
            std = np.sqrt(np.diagonal(pooled.covariance, axis1=1, axis2=2))
            # of a Gaussian with the same 90 % interval
            std = std * rule.coverage_factor / Z_90
            by_length[groups.shape[1]] = compute_metrics(
                data.targets[groups[:, 0]], pooled.mean, std, prior.std
            )
    return scores
