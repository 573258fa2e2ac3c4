"""Run a model file on reference sets, and pair its estimates with their exact posteriors."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from datagen.engines.processes import process_map
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import ABSENT_STD, COMMON_ERROR_INPUTS
from training.benchmark.bayes_limit_file import BayesLimit
from training.benchmark.sets.posterior_comparison import GaussianEstimates, PosteriorComparison
from training.benchmark.sets.reference_sets import ReferenceSet
from training.benchmark.sets.set_unknowns import RankedPosterior
from training.benchmark.sets.stream_posterior import posterior_of_memory

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Progress = Callable[[str, int, int], None]

#: Points of the midpoint rule that gives the prior's standard deviation.
PRIOR_POINTS = 4096


def compare_with_exact(
    path: str | os.PathLike[str],
    references: Sequence[ReferenceSet],
    limit: BayesLimit,
    progress: Progress = lambda text, done, total: None,
) -> list[PosteriorComparison]:
    """Compare a model file with exact posteriors, by design, on all cores.

    `limit` has the exact posteriors of `references` in the same order.
    """
    groups = [list(group) for _, group in groupby(references, key=lambda r: r.design)]
    comparisons: list[PosteriorComparison] = []
    start = 0
    with process_map(partial(_run_file, str(path)), groups) as outcomes:
        for done, (group, (estimates, posteriors)) in enumerate(
            zip(groups, outcomes, strict=True), 1
        ):
            part = limit.subset(slice(start, start := start + len(group)))
            comparisons.append(_paired(str(path), group, estimates, posteriors, part))
            progress(f"running {path}", done, len(groups))
    return comparisons


def _run_file(
    path: str, group: Sequence[ReferenceSet]
) -> tuple[GaussianEstimates, list[RankedPosterior]]:
    """Estimates of the file for sets of one design, and the posteriors that its memory defines.

    The sensors of reference sets have no common errors but the bias of torque.
    """
    estimator = Estimator.load(path)
    estimates, posteriors = [], []
    for reference in group:
        sets = reference.sets
        rows = sets.rows(0)
        for name in ("sinkage", "drawbar_pull"):
            rows[name] = np.where(rows[f"{name}_std"] < ABSENT_STD, rows[name], np.nan)
        exact = dict.fromkeys(COMMON_ERROR_INPUTS, 0.0)
        configured = estimator.on(None, **sets.context_of(0), **exact)
        estimate, memory = configured.step(configured.start(), **rows)
        estimates.append(estimate)
        system = memory.system.astype(np.float64)
        posteriors.append(posterior_of_memory(reference.family, system, sets, 0))
    keys = ("mean", "low", "high", "covariance", "in_range")
    stacked = (np.stack([getattr(e, key) for e in estimates]) for key in keys)
    return GaussianEstimates(*stacked), posteriors


def _paired(
    path: str,
    group: Sequence[ReferenceSet],
    estimates: GaussianEstimates,
    posteriors: Sequence[RankedPosterior],
    limit: BayesLimit,
) -> PosteriorComparison:
    """The comparison on the sets of one design."""
    lower, upper, prior_std = _priors(group)
    everywhere = np.ones(len(group), np.bool_)
    ends = limit.quantiles[:, [0, -1]]
    return PosteriorComparison(
        file=path,
        design=group[0].design,
        truth=np.concatenate([r.sets.truth for r in group]),
        lower=lower,
        upper=upper,
        prior_std=prior_std,
        conditions=_conditions(group),
        noise=_torque_noise(group),
        estimates=estimates,
        exact=GaussianEstimates(limit.mean, ends[:, 0], ends[:, 1], limit.covariance, everywhere),
        log_density=np.asarray([p.log_density for p in posteriors]),
        exact_log_density=limit.log_densities,
        rank=np.stack([p.rank for p in posteriors]),
        interval50=np.stack([p.quantiles[1:3] for p in posteriors]),
        exact_interval50=limit.quantiles[:, 1:3],
        flagged=limit.flagged,
    )


def _priors(group: Sequence[ReferenceSet]) -> tuple[Floats, Floats, Floats]:
    """Lower end, upper end and standard deviation of the priors, (n, q) each."""
    lower, upper, std = [], [], []
    u = (np.arange(PRIOR_POINTS) + 0.5) / PRIOR_POINTS
    for reference in group:
        context = reference.sets.context_of(0)
        axes = reference.family.axes[: reference.family.targets]
        scale = np.asarray([context.get(f"{axis.name}_max", 1.0) for axis in axes])
        lower.append(scale * [axis.ends[0] for axis in axes])
        upper.append(scale * [axis.ends[1] for axis in axes])
        std.append(scale * [axis.value(axis.quantile(u)).std() for axis in axes])
    return np.stack(lower), np.stack(upper), np.stack(std)


def _conditions(group: Sequence[ReferenceSet]) -> dict[str, Flags]:
    """For each measurement condition, the sets (n,) that it holds for."""
    origins = [r.sets.origin for r in group]
    uncertain_bearing = np.asarray([float(o.normal_std[0]) > 0.0 for o in origins])
    biases = [o.noise.get("torque_bias", (np.zeros(1), np.zeros(1))) for o in origins]
    biased = np.asarray([bool(np.max(a) > 0.0 or np.max(b) > 0.0) for a, b in biases])
    more = np.asarray([bool((r.sets.readings["sinkage_std"] < ABSENT_STD).any()) for r in group])
    return {
        "torque only": ~uncertain_bearing & ~biased & ~more,
        "uncertain bearing": uncertain_bearing,
        "sensor bias": biased,
        "sinkage and pull": more,
    }


def _torque_noise(group: Sequence[ReferenceSet]) -> Floats:
    """Standard deviation of the torque over its reading, (n,), median over rows."""
    torques = [r.sets.readings["torque"][0] for r in group]
    stds = [r.sets.readings["torque_std"][0] for r in group]
    return np.asarray(
        [float(np.median(std / np.abs(t))) for std, t in zip(stds, torques, strict=True)]
    )
