"""A model file run on reference sets, and its estimates compared with their exact posteriors."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np
from exact_sets import RankedPosterior, Unknowns, sample_posterior
from numpy.typing import NDArray
from reference_sets import ReferenceSet
from scipy.stats import chi2, chisquare

from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import ABSENT_STD, COMMON_ERROR_INPUTS
from soilml.processes import process_map
from training.benchmark.bayes_limit_file import BayesLimit
from training.benchmark.paired_results import NOMINAL, jackknife_rmse_ratio_std
from training.set_posterior.families.wheel_family import SimulatedSets, WheelFamily
from training.set_posterior.monomials import Terms, monomial_terms, monomials

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class GaussianEstimates:
    """Mean (n, q), 90 % interval (n, q) each end, covariance (n, q, q), and the sets answered."""

    mean: Floats
    low: Floats
    high: Floats
    covariance: Floats
    answered: Flags

    def contains(self, truth: Floats) -> Flags:
        """Which true values (n, q) lie in the 90 % intervals."""
        return np.asarray((truth >= self.low) & (truth <= self.high))

    def squared_mahalanobis(self, truth: Floats, prior_std: Floats) -> Floats:
        """Squared Mahalanobis distance (n,) of the truth; `prior_std` scales the inversion."""
        error = (truth - self.mean) / prior_std
        scale = prior_std[:, :, None] * prior_std[:, None, :]
        inverse = np.linalg.pinv(self.covariance / scale, rcond=1e-10, hermitian=True)
        return np.asarray(np.einsum("ni,nij,nj->n", error, inverse, error))


@dataclass(frozen=True)
class PosteriorComparison:
    """A model file and the exact posterior on the same n sets of one design.

    All arrays have the set as first axis. The *file posterior* is the one that the file's
    likelihood defines, sampled with many draws; the file itself reports mean, covariance and 90 %
    interval.

    Attributes
    ----------
    file, design
        Path of the file, and key of the design.
    truth, lower, upper, prior_std
        True values, and ends and standard deviation of the prior, (n, q).
    conditions
        For each measurement condition, which sets (n,) it holds for.
    noise
        Torque noise (n,) as a share of the reading, median over rows.
    estimates, exact
        Estimates of the file and of the exact posterior.
    log_density, exact_log_density
        Log density (n,) at the truth of the file posterior and of the exact posterior.
    rank
        Probability (n, q) below the truth under the file posterior.
    interval50, exact_interval50
        50 % interval (n, 2, q) of the file posterior and of the exact posterior.
    flagged
        Sets (n,) whose exact posterior is unreliable.
    """

    file: str
    design: str
    truth: Floats
    lower: Floats
    upper: Floats
    prior_std: Floats
    conditions: dict[str, Flags]
    noise: Floats
    estimates: GaussianEstimates
    exact: GaussianEstimates
    log_density: Floats
    exact_log_density: Floats
    rank: Floats
    interval50: Floats
    exact_interval50: Floats
    flagged: Flags

    def subset(self, index: Flags) -> PosteriorComparison:
        """The comparison on some of the sets."""
        part: PosteriorComparison = _map_arrays([self], lambda arrays: arrays[0][index])
        return part

    @property
    def rmse_ratio(self) -> tuple[Floats, Floats]:
        """RMSE over that of the exact posterior, and its jackknife standard error, (q,) each.

        Of the sets that the file answers; errors are relative to the prior's standard deviation.
        """
        answered = self.estimates.answered
        own, exact = (
            (((e.mean - self.truth) / self.prior_std)[answered]) ** 2
            for e in (self.estimates, self.exact)
        )
        ratio = np.sqrt(own.sum(axis=0) / exact.sum(axis=0))
        return ratio, jackknife_rmse_ratio_std(own, exact)

    @property
    def log_density_gap(self) -> tuple[float, float]:
        """Mean of exact log density less the file's at the truth, nat, and its standard error."""
        gap = (self.exact_log_density - self.log_density)[self.estimates.answered]
        return float(gap.mean()), float(gap.std(ddof=1) / np.sqrt(len(gap)))

    @property
    def coverage50(self) -> tuple[Floats, Floats]:
        """Coverage (q,) of the 50 % interval: of the file posterior, and of the exact one."""
        answered = self.estimates.answered
        own, exact = (
            (self.truth >= interval[:, 0]) & (self.truth <= interval[:, 1])
            for interval in (self.interval50, self.exact_interval50)
        )
        return own[answered].mean(axis=0), exact[answered].mean(axis=0)

    def coverage90(self, index: Flags | None = None) -> tuple[Floats, Floats]:
        """Coverage (q,) of the 90 % interval: of the file, and of the exact posterior.

        `index` (n, q) selects sets by parameter.
        """
        selected = self.estimates.answered[:, None] & (True if index is None else index)
        selected = np.broadcast_to(selected, self.truth.shape)
        inside = (self.estimates.contains(self.truth), self.exact.contains(self.truth))
        with np.errstate(invalid="ignore"):  # NaN where nothing is selected
            own, exact = ((i & selected).sum(axis=0) / selected.sum(axis=0) for i in inside)
        return own, exact

    @property
    def joint_coverage90(self) -> tuple[float, float]:
        """Coverage of the 90 % ellipsoid of mean and covariance: of the file, and exact."""
        most = chi2.ppf(NOMINAL, self.truth.shape[1])
        answered = self.estimates.answered
        own, exact = (
            float(np.mean(e.squared_mahalanobis(self.truth, self.prior_std)[answered] <= most))
            for e in (self.estimates, self.exact)
        )
        return own, exact


def pool_comparisons(parts: Sequence[PosteriorComparison]) -> PosteriorComparison:
    """The sets of several designs as one comparison."""
    pooled: PosteriorComparison = _map_arrays(parts, np.concatenate)
    return pooled


def _map_arrays(parts: Sequence[Any], function: Callable[[list[Any]], Any]) -> Any:
    """The first part, with each array replaced by a function of that array in all parts."""
    first = parts[0]
    if isinstance(first, np.ndarray):
        return function(list(parts))
    if isinstance(first, dict):
        return {key: _map_arrays([part[key] for part in parts], function) for key in first}
    if isinstance(first, str):
        return first
    names = [field.name for field in fields(first)]
    arrays = {n: _map_arrays([getattr(p, n) for p in parts], function) for n in names}
    return replace(first, **arrays)


def uniformity_p_values(ranks: Floats, edges: Sequence[float]) -> Floats:
    """Chi-square test (q,) of ranks (n, q) against uniformity, as p-values.

    `edges` are the interior edges of the bins of [0, 1].
    """
    bins = np.asarray([0.0, *edges, 1.0 + 1e-9])
    expected = np.diff([0.0, *edges, 1.0]) * len(ranks)
    counts = [np.histogram(own, bins)[0] for own in ranks.T]
    return np.asarray([chisquare(count, expected).pvalue for count in counts])


def response_terms(family: WheelFamily) -> Terms:
    """The monomials of a learned response of the family."""
    return monomial_terms(len(family.axes), family.degree[0], family.targets, family.degree[1])


def posterior_of_memory(
    family: WheelFamily, system: Floats, sets: SimulatedSets, index: int
) -> RankedPosterior:
    r"""The posterior of a linear system (m, terms + errors), as in `SetPosterior`, well sampled.

    .. math:: \log p(y | x) = -\tfrac12 | S^{-1} A b(x) |^2 + const, \qquad I + G G^T = S S^T

    with the last columns G the effects of errors that all readings share. They are integrated out
    by the update of Andrews (AIAA Journal 6(6), 1968), with the Cholesky factor
    :math:`I + G^T G = L L^T`:

    .. math:: A' = A - G (L + I)^{-T} L^{-1} G^T A

    The estimate of a file differs from it
    by the Monte Carlo error of its short sampling alone. Its difference from the exact posterior is
    the error of the learned response, and of a likelihood that is normal in the logarithm of a
    reading.
    """
    these = response_terms(family)
    a, g = np.split(system, [len(these)], axis=1)
    identity = np.eye(g.shape[1])
    factor = np.linalg.cholesky(identity + g.T @ g)
    a = a - g @ np.linalg.solve((factor + identity).T, np.linalg.solve(factor, g.T @ a))

    def log_likelihood(x: Floats) -> Floats:
        return np.asarray(-0.5 * ((monomials(x, these) @ a.T) ** 2).sum(axis=1))

    return sample_posterior(Unknowns.of(family, sets, index), log_likelihood, sets.origin.x[index])[
        0
    ]


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
        noise = {}
        if reference.declares_noise:
            del rows["torque_std"]
            constant, share = sets.origin.noise["torque"]
            noise = {"torque": (constant[0, 0], share[0, 0])}
        configured = estimator.on(noise, **sets.context_of(0), **exact)
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
