"""One method on sets of one design, and the Bayes limit on the very same sets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from soilml.numerics.prior import Prior
from training.benchmark.designs import Design
from training.benchmark.methods import MethodAnswers, held

Floats = NDArray[np.float64]

#: Share of truths that intervals and ellipsoids are to hold.
NINETY = 0.9


@dataclass(frozen=True)
class Result:
    """Answers of a method beside truth (n, q) and the limit's mean (n, q), of the same sets.

    `effect` names what the method's model lacks, blank where nothing. `density`, where the method
    knows it, is the logarithm of its density at the truth (n,), parameters as fractions of their
    priors, and `denser` the share of its density that is denser than there; NaN elsewhere.
    """

    design: Design
    effect: str
    method: str
    inputs: str
    priors: tuple[Prior, ...]
    truth: Floats
    answers: MethodAnswers
    limit: Floats
    density: Floats
    denser: Floats

    def where(self, index: NDArray[np.bool_]) -> Result:
        """The same of some sets."""
        return replace(
            self,
            truth=self.truth[index],
            answers=self.answers.rows(index),
            limit=self.limit[index],
            density=self.density[index],
            denser=self.denser[index],
        )

    @property
    def driven(self) -> str:
        """The design, and the effect that no method knows, in words."""
        return ", ".join(filter(None, (self.design.text, self.effect)))

    @property
    def sets(self) -> int:
        """How many sets there are."""
        return len(self.truth)

    @property
    def never(self) -> NDArray[np.bool_]:
        """Parameters (q,) that the method does not estimate."""
        return np.asarray(~np.isfinite(self.answers.mean).any(axis=0))

    @property
    def failed(self) -> int:
        """Sets without an answer."""
        given = np.isfinite(self.answers.mean[:, ~self.never])
        return int((~given).any(axis=1).sum()) if given.shape[1] else self.sets

    @property
    def error(self) -> Floats:
        """Estimate less truth (n, q), NaN for parameters that are not estimated.

        Values outside the prior are moved to its edge, and a failed fit counts as its middle.
        """
        middle = _columns(self.priors, lambda p: float(p.at(np.asarray(0.5))))
        lower = _columns(self.priors, lambda p: p.lower)
        upper = _columns(self.priors, lambda p: p.upper)
        given = self.answers.mean
        value = np.where(np.isfinite(given), np.clip(given, lower, upper), middle)
        return np.where(self.never, np.nan, value - self.truth)

    @property
    def rmse(self) -> Floats:
        """Root mean squared error (q,)."""
        return np.asarray(np.sqrt(np.mean(self.error**2, axis=0)))

    @property
    def relative(self) -> Floats:
        """The same over the prior's standard deviation."""
        return self.rmse / _columns(self.priors, lambda p: p.std)

    @property
    def ratio(self) -> Floats:
        """RMSE over the limit's RMSE on the same sets, (q,)."""
        return np.asarray(self.rmse / np.sqrt(np.mean((self.limit - self.truth) ** 2, axis=0)))

    @property
    def ratio_std(self) -> Floats:
        r"""Standard error of `ratio`, (q,): the jackknife over sets.

        .. math:: \sigma^2 = \frac{n - 1}{n} \sum_i (r_{(i)} - \bar{r})^2

        with r_(i) the ratio without set i. Errors of method and limit go together, so that it is
        smaller than that of either RMSE. Reference: Efron and Stein, Annals of Statistics 9, 1981.
        """
        own, least = self.error**2, (self.limit - self.truth) ** 2
        left = np.sqrt((own.sum(axis=0) - own) / (least.sum(axis=0) - least))
        n = self.sets
        return np.asarray(np.sqrt((n - 1) / n * ((left - left.mean(axis=0)) ** 2).sum(axis=0)))

    @property
    def cover50(self) -> Floats:
        """Share (q,) of truths inside the method's 50 % interval, of the sets answered."""
        return held(self.truth, self.answers.inner)

    @property
    def cover90(self) -> Floats:
        """Share (q,) of truths inside the method's 90 % interval, of the sets answered."""
        return held(self.truth, self.answers.outer)

    @property
    def joint90(self) -> float:
        r"""Share of truths inside the 90 % ellipsoid of all parameters that are estimated.

        .. math:: (\theta^* - \mu)^T \Sigma^{-1} (\theta^* - \mu) \le \chi^2_q(0.9)

        An exact posterior that is no Gaussian need not hold 90 % by it: read it beside the limit's.
        """
        own = ~self.never
        width = _columns(self.priors, lambda p: p.std)[own]
        off = ((self.answers.mean - self.truth)[:, own]) / width
        spread = self.answers.covariance[:, own][:, :, own] / np.outer(width, width)
        there = np.isfinite(off).all(axis=1)
        if not own.any() or not there.any():
            return float("nan")
        inverse = np.linalg.pinv(spread[there], rcond=1e-12, hermitian=True)
        square = np.einsum("ni,nij,nj->n", off[there], inverse, off[there])
        return float(np.mean(square <= chi2.ppf(NINETY, own.sum())))

    @property
    def flagged(self) -> float:
        """Share of sets that the method itself says not to believe."""
        return float(np.mean(self.answers.flagged))

    @property
    def log_density(self) -> float:
        """Mean logarithm of the density at the truth: 0 is the prior's, no method has the limit's.

        A Gaussian's for a method that gives mean and covariance; a failed set counts as the prior.
        """
        if self.never.any() and np.isnan(self.density).all():
            return float("nan")
        known = np.where(np.isnan(self.density), self._gaussian(), self.density)
        return float(np.mean(known))

    def _gaussian(self) -> Floats:
        rates = []
        for prior, truth in zip(self.priors, self.truth.T, strict=True):
            rates.append(prior.rate(np.asarray([prior.fraction(float(t)) for t in truth])))
        rate = np.stack(rates, axis=1)
        there = np.asarray(np.isfinite(self.answers.mean).all(axis=1))
        spread = self.answers.covariance / (rate[:, :, None] * rate[:, None, :])
        spread = np.where(there[:, None, None], spread, np.eye(len(self.priors)))
        off = np.where(there[:, None], (self.answers.mean - self.truth) / rate, 0.0)
        sign, size = np.linalg.slogdet(2.0 * np.pi * spread)
        square = np.einsum("ni,nij,nj->n", off, np.linalg.pinv(spread, hermitian=True), off)
        logs = np.where(sign > 0, -0.5 * (size + square), -np.inf)
        return np.where(there, logs, 0.0)


def _columns(priors: Sequence[Prior], figure: Callable[[Prior], float]) -> Floats:
    return np.asarray([figure(p) for p in priors])
