"""Estimates of a model file on reference sets, compared with the exact posteriors of these sets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, chisquare

from training.benchmark.paired_results import NOMINAL, jackknife_rmse_ratio_std

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


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
