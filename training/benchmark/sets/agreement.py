"""What a file answers on reference sets, beside their exact posteriors."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, chisquare

from soilml.onboard.estimator import Estimator
from training.benchmark.bayes_limit_file import BayesLimit
from training.benchmark.sets.posterior_summary import ExactSetPosterior
from training.benchmark.sets.reference_sets import PROCESSES, Reference
from training.benchmark.sets.stream_posterior import posterior_of_memory
from training.set_posterior.wheel_family import ABSENT

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Progress = Callable[[str, int, int], None]

NINETY = 0.9


@dataclass(frozen=True)
class FileAnswers:
    """Mean, ends of the 90 % interval (n, q), covariance (n, q, q), and which sets it answers."""

    mean: Floats
    low: Floats
    high: Floats
    covariance: Floats
    given: Flags

    def holds(self, truth: Floats) -> Flags:
        """Which truths (n, q) the intervals hold."""
        return np.asarray((truth >= self.low) & (truth <= self.high))

    def apart(self, truth: Floats, spread: Floats) -> Floats:
        """Squared Mahalanobis distance (n,) of the truth."""
        off = (truth - self.mean) / spread
        width = spread[:, :, None] * spread[:, None, :]
        inverse = np.linalg.pinv(self.covariance / width, rcond=1e-10, hermitian=True)
        return np.asarray(np.einsum("ni,nij,nj->n", off, inverse, off))


@dataclass(frozen=True)
class Agreement:
    """A file and the exact posterior on the same sets of one design; arrays are by set first.

    `stood_for` is the posterior that the file's likelihood has, sampled at length: log density at
    the truth, share below the truth (q,), and ends of the middle half (2, q).
    """

    file: str
    design: str
    truth: Floats
    lower: Floats  # ends and standard deviation of the prior
    upper: Floats
    spread: Floats
    kinds: dict[str, Flags]
    noise: Floats  # (n,) of torque, as a share
    own: FileAnswers
    exact: FileAnswers
    density: Floats  # (n,) log density at the truth: of what the file stands for, and exact
    dense: Floats
    below: Floats  # (n, q)
    inner: Floats  # (n, 2, q)
    least_inner: Floats
    flagged: Flags  # the reference itself is not to be believed

    def where(self, index: Flags) -> Agreement:
        """The same of some sets."""
        found: Agreement = _arrays([self], lambda one: one[0][index])
        return found

    @property
    def ratio(self) -> tuple[Floats, Floats]:
        """RMSE over the exact posterior's, and its standard error by the jackknife, (q,) each.

        Of the sets that the file answers. Errors are over the prior's standard deviation. Both err
        alike, so that the standard error is smaller than that of either RMSE.
        """
        there = self.own.given
        squares = [
            (((a.mean - self.truth) / self.spread)[there]) ** 2 for a in (self.own, self.exact)
        ]
        own, least = squares
        n = len(own)
        left = np.sqrt((own.sum(axis=0) - own) / (least.sum(axis=0) - least))
        error = np.sqrt((n - 1) / n * ((left - left.mean(axis=0)) ** 2).sum(axis=0))
        return np.sqrt(own.sum(axis=0) / least.sum(axis=0)), np.asarray(error)

    @property
    def gap(self) -> tuple[float, float]:
        """Mean log density that the file lacks at the truth, nat, and its standard error."""
        off = (self.dense - self.density)[self.own.given]
        return float(off.mean()), float(off.std(ddof=1) / np.sqrt(len(off)))

    @property
    def cover50(self) -> tuple[Floats, Floats]:
        """Shares (q,) of truths in the middle half: of what the file stands for, and exact."""
        there = self.own.given
        found = [
            (self.truth >= half[:, 0]) & (self.truth <= half[:, 1])
            for half in (self.inner, self.least_inner)
        ]
        return found[0][there].mean(axis=0), found[1][there].mean(axis=0)

    def cover90(self, index: Flags | None = None) -> tuple[Floats, Floats]:
        """Shares (q,) of truths in the 90 % interval: the file's, and the exact one; `index` (n, q)
        chooses sets by parameter."""
        chosen = self.own.given[:, None] & (True if index is None else index)
        chosen = np.broadcast_to(chosen, self.truth.shape)
        held = (self.own.holds(self.truth), self.exact.holds(self.truth))
        with np.errstate(invalid="ignore"):
            own, least = ((h & chosen).sum(axis=0) / chosen.sum(axis=0) for h in held)
        return own, least

    @property
    def joint90(self) -> tuple[float, float]:
        """Shares of truths in the 90 % ellipsoid of mean and covariance: the file's, the exact."""
        most = chi2.ppf(NINETY, self.truth.shape[1])
        there = self.own.given
        own, least = (
            float(np.mean(a.apart(self.truth, self.spread)[there] <= most))
            for a in (self.own, self.exact)
        )
        return own, least


def combined(parts: Sequence[Agreement]) -> Agreement:
    """Sets of several designs as one."""
    found: Agreement = _arrays(parts, np.concatenate)
    return found


def _arrays(parts: Sequence[Any], made: Callable[[list[Any]], Any]) -> Any:
    """The first with every array made from those of all parts, however deep."""
    first = parts[0]
    if isinstance(first, np.ndarray):
        return made(list(parts))
    if isinstance(first, dict):
        return {key: _arrays([part[key] for part in parts], made) for key in first}
    if isinstance(first, str):
        return first
    names = [field.name for field in fields(first)]
    return replace(first, **{n: _arrays([getattr(p, n) for p in parts], made) for n in names})


def uniform(shares: Floats, ends: Sequence[float]) -> Floats:
    """Chance (q,) that shares (n, q), uniform, fall into bins no more evenly; chi-square."""
    bins = np.asarray([0.0, *ends, 1.0 + 1e-9])
    expected = np.diff([0.0, *ends, 1.0]) * len(shares)
    counts = [np.histogram(own, bins)[0] for own in shares.T]
    return np.asarray([chisquare(count, expected).pvalue for count in counts])


def agreement(
    path: str | os.PathLike[str],
    references: Sequence[Reference],
    limit: BayesLimit,
    progress: Progress = lambda text, done, total: None,
) -> list[Agreement]:
    """A file on reference sets, by design; `limit` has their exact posteriors in the same order."""
    groups = [list(g) for _, g in groupby(references, key=lambda r: r.design)]
    found: list[Agreement] = []
    start = 0
    with ProcessPoolExecutor(min(PROCESSES, os.cpu_count() or 1)) as pool:
        asked = pool.map(partial(_asked, str(path)), groups)
        for done, (group, answered) in enumerate(zip(groups, asked, strict=True), 1):
            part = slice(start, start := start + len(group))
            found.append(_beside(str(path), group, answered, limit.rows(part)))
            progress(f"asking {path}", done, len(groups))
    return found


def _asked(path: str, group: Sequence[Reference]) -> tuple[FileAnswers, list[ExactSetPosterior]]:
    """Answers of the file to sets of one design, and the posteriors that it stands for."""
    estimator = Estimator.load(path)
    estimates, stood_for = [], []
    for reference in group:
        sets = reference.sets
        rows = sets.rows(0)
        for name in ("sinkage", "drawbar_pull"):
            rows[name] = np.where(rows[f"{name}_std"] < ABSENT, rows[name], np.nan)
        own = estimator.on(None, **sets.given(0)) if sets.context else estimator
        estimate, memory = own.step(own.start(), **rows)
        estimates.append(estimate)
        system = memory.system.astype(np.float64)
        stood_for.append(posterior_of_memory(reference.family, system, sets, 0))
    keys = ("mean", "low", "high", "covariance", "in_range")
    return FileAnswers(*(np.stack([getattr(e, key) for e in estimates]) for key in keys)), stood_for


def _beside(
    path: str,
    group: Sequence[Reference],
    answered: tuple[FileAnswers, list[ExactSetPosterior]],
    limit: BayesLimit,
) -> Agreement:
    own, stood_for = answered
    given = [r.sets.given(0) for r in group]
    lower, upper, spread = [], [], []
    u = (np.arange(4096) + 0.5) / 4096
    for reference, context in zip(group, given, strict=True):
        axes = reference.family.axes[: reference.family.targets]
        scale = np.asarray([context.get(f"{axis.name}_max", 1.0) for axis in axes])
        lower.append(scale * [axis.ends[0] for axis in axes])
        upper.append(scale * [axis.ends[1] for axis in axes])
        spread.append(scale * [axis.value(axis.drawn(u)).std() for axis in axes])
    origins = [r.sets.origin for r in group]
    unknown = np.asarray([float(o.near[0]) > 0.0 for o in origins])
    shares = [o.noise.get("torque_bias", (np.zeros(1), np.zeros(1))) for o in origins]
    biased = np.asarray([bool(np.max(a) > 0.0 or np.max(b) > 0.0) for a, b in shares])
    told = np.asarray([bool((r.sets.readings["sinkage_std"] < ABSENT).any()) for r in group])
    torque = [r.sets.readings["torque"][0] for r in group]
    stds = [r.sets.readings["torque_std"][0] for r in group]
    noise = [float(np.median(s / np.abs(t))) for s, t in zip(stds, torque, strict=True)]
    outer = limit.quantiles[:, [0, -1]]
    return Agreement(
        file=path,
        design=group[0].design,
        truth=np.concatenate([r.sets.truth for r in group]),
        lower=np.stack(lower),
        upper=np.stack(upper),
        spread=np.stack(spread),
        kinds={
            "torque alone": ~unknown & ~biased & ~told,
            "bearing nearly known": unknown,
            "sensor bias": biased,
            "sinkage and pull": told,
        },
        noise=np.asarray(noise),
        own=own,
        exact=FileAnswers(
            limit.mean, outer[:, 0], outer[:, 1], limit.covariance, np.ones(len(group), np.bool_)
        ),
        density=np.asarray([f.density for f in stood_for]),
        dense=limit.density,
        below=np.stack([f.below for f in stood_for]),
        inner=np.stack([f.quantiles[1:3] for f in stood_for]),
        least_inner=limit.quantiles[:, 1:3],
        flagged=limit.flagged,
    )
