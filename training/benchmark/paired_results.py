"""Scores of a method on sets whose soil is known, alone and paired with their Bayes limit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from soilml.arrays import Floats
from soilml.numerics.prior import Prior
from training.benchmark.designs import Design
from training.benchmark.methods import MethodEstimates, MethodKind

NOMINAL = 0.9  # Nominal coverage of intervals, ellipsoids and highest-density regions


@dataclass(frozen=True)
class MethodResult:
    """Estimates of a method, with the true values of the same n sets of one size.

    Estimates outside the prior are clipped to it, and a failed one counts as its median. Figures of
    parameters that the method does not estimate are NaN.
    """

    rows: int  # readings of a set
    #: label, kind and inputs of the method
    method: str
    kind: MethodKind
    inputs: str
    #: priors and true values (n, q) of the parameters, SI units
    priors: tuple[Prior, ...]
    truth: Floats
    estimates: MethodEstimates  # the method's estimates

    @property
    def sets(self) -> int:
        """Number of sets."""
        return len(self.truth)

    @property
    def not_estimated(self) -> NDArray[np.bool_]:
        """Parameters (q,) that the method does not estimate."""
        return np.asarray(~np.isfinite(self.estimates.mean).any(axis=0))

    @property
    def failed(self) -> int:
        """Number of sets without an estimate."""
        answered = np.isfinite(self.estimates.mean[:, ~self.not_estimated])
        return int((~answered).any(axis=1).sum()) if answered.shape[1] else self.sets

    @property
    def error(self) -> Floats:
        """Estimate less truth (n, q), SI units."""
        median = _of_priors(self.priors, lambda p: float(p.at(np.asarray(0.5))))
        lower = _of_priors(self.priors, lambda p: p.lower)
        upper = _of_priors(self.priors, lambda p: p.upper)
        mean = self.estimates.mean
        value = np.where(np.isfinite(mean), np.clip(mean, lower, upper), median)
        return np.where(self.not_estimated, np.nan, value - self.truth)

    @property
    def rmse(self) -> Floats:
        """Root mean squared error (q,), SI units."""
        return np.asarray(np.sqrt(np.mean(self.error**2, axis=0)))

    @property
    def rmse_over_prior(self) -> Floats:
        """RMSE (q,) over the prior's standard deviation."""
        return self.rmse / _of_priors(self.priors, lambda p: p.std)

    @property
    def coverage50(self) -> Floats:
        """Coverage (q,) of the method's 50 % intervals, of the sets answered."""
        return _interval_coverage(self.truth, self.estimates.interval50)

    @property
    def coverage90(self) -> Floats:
        """Coverage (q,) of the method's 90 % intervals, of the sets answered."""
        return _interval_coverage(self.truth, self.estimates.interval90)


@dataclass(frozen=True)
class PairedResult(MethodResult):
    """The same with the Bayes limit of these sets, which have one design."""

    #: experimental design, and the effect that the method's model lacks (blank where none)
    design: Design
    effect: str
    limit_mean: Floats  # mean (n, q) of the exact posterior
    #: logarithm (n,) of the method's own density at the truth, parameters as fractions of
    #: their priors, where it is available; NaN elsewhere
    log_densities: Floats
    #: share (n,) of the method's density that is higher than at the truth; NaN elsewhere
    hpd_levels: Floats

    def subset(self, index: NDArray[np.bool_]) -> PairedResult:
        """The result on some of the sets."""
        return replace(
            self,
            truth=self.truth[index],
            estimates=self.estimates.subset(index),
            limit_mean=self.limit_mean[index],
            log_densities=self.log_densities[index],
            hpd_levels=self.hpd_levels[index],
        )

    @property
    def description(self) -> str:
        """The design and the unmodelled effect, in words."""
        return ", ".join(filter(None, (self.design.description, self.effect)))

    @property
    def rmse_ratio(self) -> Floats:
        """RMSE (q,) over that of the Bayes limit on the same sets."""
        return np.asarray(self.rmse / np.sqrt(np.mean((self.limit_mean - self.truth) ** 2, axis=0)))

    @property
    def rmse_ratio_std(self) -> Floats:
        """Standard error (q,) of `rmse_ratio`, by `jackknife_rmse_ratio_std`."""
        return jackknife_rmse_ratio_std(self.error**2, (self.limit_mean - self.truth) ** 2)

    @property
    def rmse_std(self) -> Floats:
        """Standard error (q,) of `rmse` over sets, SI units."""
        square = self.error**2
        return np.asarray(square.std(axis=0) / np.sqrt(self.sets) / (2.0 * self.rmse))

    @property
    def joint_coverage90(self) -> float:
        r"""Coverage of the 90 % ellipsoid of all parameters that are estimated.

        .. math:: (\theta^* - \mu)^T \Sigma^{-1} (\theta^* - \mu) \le \chi^2_q(0.9)

        The ellipsoid of an exact posterior that is not Gaussian need not have 90 % coverage:
        compare with the figure of the Bayes limit.
        """
        estimated = ~self.not_estimated
        width = _of_priors(self.priors, lambda p: p.std)[estimated]
        error = ((self.estimates.mean - self.truth)[:, estimated]) / width
        covariance = self.estimates.covariance[:, estimated][:, :, estimated]
        covariance = covariance / np.outer(width, width)
        answered = np.isfinite(error).all(axis=1)
        if not estimated.any() or not answered.any():
            return float("nan")
        inverse = np.linalg.pinv(covariance[answered], rcond=1e-12, hermitian=True)
        square = np.einsum("ni,nij,nj->n", error[answered], inverse, error[answered])
        return float(np.mean(square <= chi2.ppf(NOMINAL, estimated.sum())))

    @property
    def flagged_fraction(self) -> float:
        """Fraction of sets whose estimate the method itself reports as unreliable."""
        return float(np.mean(self.estimates.flagged))

    @property
    def log_score(self) -> float:
        """Mean log posterior density at the truth (logarithmic score), nat; larger is better.

        The prior has 0. In expectation no method exceeds the Bayes limit. Where a method reports
        mean and covariance alone, its density is Gaussian; a failed set counts as the prior. NaN
        where a parameter is not estimated.

        References: Gneiting and Raftery, Strictly proper scoring rules, prediction, and estimation,
        J. American Statistical Association 102, 2007.
        """
        if self.not_estimated.any() and np.isnan(self.log_densities).all():
            return float("nan")
        gaussian = self._gaussian_log_densities()
        densities = np.where(np.isnan(self.log_densities), gaussian, self.log_densities)
        return float(np.mean(densities))

    def _gaussian_log_densities(self) -> Floats:
        """Log density (n,) at the truth, of parameters as fractions of their priors."""
        rates = []  # derivative of each parameter with respect to its fraction of the prior
        for prior, truth in zip(self.priors, self.truth.T, strict=True):
            rates.append(prior.rate(np.asarray([prior.fraction(float(t)) for t in truth])))
        rate = np.stack(rates, axis=1)
        answered = np.asarray(np.isfinite(self.estimates.mean).all(axis=1))
        covariance = self.estimates.covariance / (rate[:, :, None] * rate[:, None, :])
        covariance = np.where(answered[:, None, None], covariance, np.eye(len(self.priors)))
        error = np.where(answered[:, None], (self.estimates.mean - self.truth) / rate, 0.0)
        sign, log_det = np.linalg.slogdet(2.0 * np.pi * covariance)
        inverse = np.linalg.pinv(covariance, hermitian=True)
        square = np.einsum("ni,nij,nj->n", error, inverse, error)
        logs = np.where(sign > 0, -0.5 * (log_det + square), -np.inf)
        return np.where(answered, logs, 0.0)


def _of_priors(priors: Sequence[Prior], figure: Callable[[Prior], float]) -> Floats:
    return np.asarray([figure(p) for p in priors])


def _interval_coverage(truth: Floats, ends: Floats) -> Floats:
    """Fraction (q,) of true values (n, q) in intervals (n, 2, q), of the intervals not NaN."""
    finite = np.isfinite(ends).all(axis=1)
    inside = (truth >= ends[:, 0]) & (truth <= ends[:, 1]) & finite
    count = finite.sum(axis=0)
    return np.where(count > 0, inside.sum(axis=0) / np.maximum(count, 1), np.nan)


def jackknife_rmse_ratio_std(squares: Floats, reference_squares: Floats) -> Floats:
    r"""Jackknife standard error (q,) of the ratio of two RMSE values on the same n sets.

    .. math:: \sigma^2 = \frac{n - 1}{n} \sum_i (r_{(i)} - \bar{r})^2

    with r_(i) the ratio of the RMSE values without set i. One set alone has none: NaN.

    squares, reference_squares: Squared errors (n, q) of the method and of its reference. They are
        paired: because both errors are correlated, the standard error is smaller than that of
        either RMSE alone.

    References: Efron and Stein, The jackknife estimate of variance, Annals of Statistics 9, 1981.
    """
    n = len(squares)
    if n < 2:
        return np.full(squares.shape[1:], np.nan)
    leave_one_out = np.sqrt(
        (squares.sum(axis=0) - squares) / (reference_squares.sum(axis=0) - reference_squares)
    )
    deviations = (leave_one_out - leave_one_out.mean(axis=0)) ** 2
    return np.asarray(np.sqrt((n - 1) / n * deviations.sum(axis=0)))
