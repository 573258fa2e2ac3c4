r"""All that is no effect, as one Gaussian: discrepancy, scatter from run to run, noise.

.. math::
    y = f(x) + \sum_g \tau_g U_g v_g + e, \quad v_g \sim N(0, I), \quad
    e_c \sim N(0, s_c^2 D_c R_\rho D_c)

The columns U are eigenfunctions of a smooth discrepancy in slip and log load, of each channel; and
the change of each reading of each run with a unit of friction angle and of the bearing moduli. For
the soil, errors that all rows share are further columns (`shared_columns`).
D has the declared standard deviations, R the correlation of neighbouring samples of a run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Integers
from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.covariance import Whitening, discrepancy_process
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.inference import constants
from soilml.inference.scatter_elimination import Products, by_cell, scatter_whitening
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.soils import Soil
from soilml.quantities import column

Booleans = NDArray[np.bool_]

#: Eigenfunctions of the discrepancy with a smaller fraction of the largest eigenvalue are dropped.
LEAST_EIGENVALUE = 1e-3
#: Bounds of the logarithms of amplitudes of discrepancy, of scatter, and of noise scales.
AMPLITUDE_BOUNDS, SCATTER_BOUNDS, NOISE_BOUNDS = (-3.5, 3.7), (-3.0, 2.0), (0.0, 2.3)
#: Where hyperparameters start: logarithms of usual amplitudes and of usual scatter, a bit less.
FIRST_AMPLITUDE, FIRST_SCATTER = -0.5, -0.3
#: Kinds of hyperparameters.
DISCREPANCY, SCATTER = "discrepancy", "scatter"
#: Group of columns whose weights have unit variance.
FIXED = -1
KEPT = 24  # Whitened columns that are kept, by autocorrelation and outliers


@dataclass(frozen=True)
class Hyperparameters:
    """Standard deviations of the terms, and scales of the noise.

    log: Logarithms (groups + channels,): of tau by group, then of s by channel.
    present: Whether there is a discrepancy.
    autocorrelation: Of neighbouring samples of a run.
    """

    log: Floats
    present: bool
    autocorrelation: float = 0.0


@dataclass(frozen=True, eq=False)
class GaussianTerms:
    """The columns of all Gaussian terms of m readings.

    columns (m, q), group (q,): Columns, and the hyperparameter of each; `FIXED` for unit variance.
    kinds (groups,): Whether a hyperparameter is of the discrepancy or of scatter.
    usual (channels,): Standard deviation of a usual discrepancy, in the unit of the channel.
    """

    readings: Readings
    columns: Floats
    group: Integers
    kinds: tuple[str, ...]
    usual: Floats
    _kept: dict[tuple[float, bytes], WhitenedColumns] = field(default_factory=dict)

    @staticmethod
    def of_columns(readings: Readings, columns: Floats) -> GaussianTerms:
        """Terms of known size alone: columns (m, q) of unit variance, and the noise."""
        group = np.full(columns.shape[1], FIXED)
        return GaussianTerms(readings, columns, group, (), np.ones(len(readings.channels)))

    @cached_property
    def without_scatter(self) -> Integers:
        """Numbers of the columns that are not of scatter."""
        return np.flatnonzero(~self._of_scatter)

    @cached_property
    def scatter_change(self) -> Floats:
        """Change (m, s) of each reading by one unit of scatter of its own run."""
        found = self.columns[:, self._of_scatter]
        s = self.kinds.count(SCATTER)
        if not found.shape[1]:
            return np.zeros((len(found), s))
        return found.reshape(len(found), -1, s)[np.arange(len(found)), self.run]

    @cached_property
    def _of_scatter(self) -> Booleans:
        return np.asarray([*(own == SCATTER for own in self.kinds), False])[self.group]

    @cached_property
    def run(self) -> Integers:
        """Run (m,) of each reading."""
        return np.asarray(self.readings.run[self.readings.row])

    @cached_property
    def runs_with_scatter(self) -> int:
        """Number of the runs that have scatter of their own: all, or none where there is one."""
        return int(np.count_nonzero(self._of_scatter)) // max(self.kinds.count(SCATTER), 1)

    def scatter_std(self, at: Hyperparameters) -> Floats:
        """Standard deviations (s,) of scatter, in units, whether or not there are several runs."""
        return np.exp(at.log[self.of_kind(SCATTER)])

    @property
    def channels(self) -> int:
        """Number of channels."""
        return len(self.readings.channels)

    @property
    def groups(self) -> int:
        """Number of standard deviations among the hyperparameters."""
        return len(self.kinds)

    def of_kind(self, kind: str) -> Booleans:
        """Which hyperparameters (groups + channels,) are of a kind."""
        return self._masks[kind]

    @cached_property
    def _masks(self) -> dict[str, Booleans]:
        rest = (False,) * self.channels
        kinds = (DISCREPANCY, SCATTER)
        return {k: np.asarray([*(own == k for own in self.kinds), *rest], bool) for k in kinds}

    def amplitude(self, at: Hyperparameters) -> Floats:
        """Amplitude of each channel's discrepancy, (channels,), in usual ones."""
        return np.exp(at.log[: self.channels]) * at.present

    def scatter(self, at: Hyperparameters) -> Floats:
        """Standard deviations (2,) from run to run, in units; zero where there is one run."""
        several = len(np.unique(self.readings.run[self.readings.row])) > 1
        return np.exp(at.log[self.of_kind(SCATTER)]) * several

    def noise_scale(self, at: Hyperparameters) -> Floats:
        """Noise over the declared one, (channels,)."""
        return np.exp(at.log[self.groups :])

    @property
    def largest_outlier(self) -> Floats:
        """Standard deviation (m,) with which a reading strays."""
        r = self.readings
        span = [np.ptp(np.append(r.measured[r.channel == c], 0.0)) for c in range(len(r.channels))]
        return constants.OUTLIER_WIDTH * np.asarray(span)[r.channel]

    def first(self) -> Hyperparameters:
        """Usual scatter and discrepancy, declared noise."""
        by_kind = {DISCREPANCY: FIRST_AMPLITUDE, SCATTER: FIRST_SCATTER}
        log = [*(by_kind[kind] for kind in self.kinds), *(0.0,) * self.channels]
        return Hyperparameters(np.asarray(log), present=True)

    def bounds(self) -> list[tuple[float, float]]:
        """Bounds of the logarithms of the hyperparameters."""
        by_kind = {DISCREPANCY: AMPLITUDE_BOUNDS, SCATTER: SCATTER_BOUNDS}
        return [*(by_kind[kind] for kind in self.kinds), *(NOISE_BOUNDS,) * self.channels]

    def variance(self, at: Hyperparameters) -> Floats:
        """Variance (q,) of the weight of each column."""
        log = np.append(at.log[: self.groups], 0.0)  # the last one is that of fixed columns
        square = np.exp(2.0 * log)
        if not at.present:
            square[: self.groups][self.of_kind(DISCREPANCY)[: self.groups]] = 0.0
        return np.asarray(square[self.group])

    def whitened(self, autocorrelation: float, kept: Booleans) -> WhitenedColumns:
        """The columns whitened by the declared noise of the readings that are kept."""
        key = autocorrelation, kept.tobytes()
        if key not in self._kept:
            while len(self._kept) >= KEPT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = _whitened(self, autocorrelation, kept)
        return self._kept[key]

    def whiten(self, at: Hyperparameters, outliers: Booleans) -> Whitening:
        """What makes the covariance of the readings one; outliers weigh nothing.

        Scatter is whitened first: its columns of two runs share no reading.
        """
        noise: Any
        noise, _ = noise_whitening(self.readings, ~outliers, at.autocorrelation)
        scale = 1.0 / self.noise_scale(at)[self.readings.channel]
        noise = scale * noise if noise.ndim == 1 else noise.multiply(scale[:, None]).tocsr()
        if self.runs_with_scatter:
            change = self.scatter_change * self.scatter_std(at)
            noise = scatter_whitening(noise, change, self.run, self.runs_with_scatter)
        variance = self.variance(at)[self.without_scatter]
        used = variance > 0.0
        columns = self.columns[:, self.without_scatter[used]] * np.sqrt(variance[used])
        return Whitening.beside(noise, columns)

    def noise_std(self, at: Hyperparameters) -> Floats:
        """Standard deviation (m,) of the noise."""
        return np.asarray(self.readings.std * self.noise_scale(at)[self.readings.channel])

    def without_discrepancy(self, at: Hyperparameters) -> Hyperparameters:
        """The same noise and scatter, and no discrepancy."""
        return replace(at, present=False)

    def std(self, at: Hyperparameters) -> Floats:
        """Standard deviation (m,) of the readings by noise and scatter."""
        variance = self.variance(replace(at, present=False))
        return np.asarray(np.sqrt(self.noise_std(at) ** 2 + (self.columns**2) @ variance))


@dataclass(frozen=True)
class WhitenedColumns:
    """Columns whitened by the declared noise, and their products by channel."""

    noise: Any  # what whitens: (m,) or sparse (m, m)
    columns: Floats  # (m, q), those of scatter apart; zero for readings that are left out
    gram: Floats  # (channels, q, q)
    scatter: Any  # sparse (channels R s, m): scatter by channel and run
    runs: Floats  # (channels, R, s, s + q): products of scatter with itself and the columns
    log_determinant: float  # of the noise of those that are kept
    counts: Floats  # (channels,) readings that are kept

    def products_with(self, terms: GaussianTerms, own: Floats) -> Products:
        """The products, with those of further whitened columns (m, k)."""
        q, k = self.columns.shape[1], own.shape[1]
        others = np.zeros((terms.channels, q + k, q + k))
        others[:, :q, :q] = self.gram
        for c in range(terms.channels):
            of = terms.readings.channel == c
            others[c, :q, q:] = self.columns[of].T @ own[of]
            others[c, q:, :q] = others[c, :q, q:].T
            others[c, q:, q:] = own[of].T @ own[of]
        further = np.reshape(self.scatter @ own, (*self.runs.shape[:3], k))
        runs = np.concatenate([self.runs, further], axis=-1)
        return Products(runs, others, self.counts, self.log_determinant)


def _whitened(terms: GaussianTerms, autocorrelation: float, kept: Booleans) -> WhitenedColumns:
    noise, log_determinant = noise_whitening(terms.readings, kept, autocorrelation)
    change = terms.scatter_change
    every = np.column_stack([change, terms.columns[:, terms.without_scatter]])
    every = noise[:, None] * every if noise.ndim == 1 else noise @ every
    channel, count, s = terms.readings.channel, terms.runs_with_scatter, change.shape[1]
    white, cells = every[:, s:], terms.channels * count
    scatter = by_cell(every[:, :s], channel * count + terms.run, cells).T.tocsr()
    runs = np.reshape(scatter @ every, (terms.channels, count, s, every.shape[1]))
    by = [white[channel == c] for c in range(terms.channels)]
    counts = np.bincount(channel[kept], minlength=terms.channels).astype(np.float64)
    gram = np.stack([w.T @ w for w in by])
    return WhitenedColumns(noise, white, gram, scatter, runs, log_determinant, counts)


def noise_whitening(
    readings: Readings, kept: Booleans, autocorrelation: float
) -> tuple[Any, float]:
    r"""What whitens declared noise, zero for readings left out, and ln of its determinant.

    Samples of a first-order autoregressive series depend on the sample before alone:

    .. math:: w_i = \frac{y_i / \sigma_i - \rho^d y_{i-1} / \sigma_{i-1}}{\sqrt{1 - \rho^{2 d}}}

    with d the number of samples between the two. A vector (m,) without autocorrelation, else a
    sparse matrix (m, m).
    """
    inverse = np.where(kept, 1.0 / readings.std, 0.0)
    log_determinant = 2.0 * float(np.log(readings.std[kept]).sum())
    if autocorrelation == 0.0:
        return inverse, log_determinant
    from scipy.sparse import csr_array

    run, sample = readings.run[readings.row], readings.order[readings.row]
    key = np.lexsort((sample, readings.channel, run))
    key = key[kept[key]]
    follows = (np.diff(run[key]) == 0) & (np.diff(readings.channel[key]) == 0)
    lag = np.where(follows, np.diff(sample[key]), 1)
    correlation = np.concatenate([[0.0], np.where(follows, autocorrelation**lag, 0.0)])
    left = np.sqrt(1.0 - correlation**2)
    own, second = inverse[key] / left, (-correlation[1:] * inverse[key[:-1]] / left[1:])
    m = len(readings)
    rows = np.concatenate([key, key[1:]])
    columns = np.concatenate([key, key[:-1]])
    matrix = csr_array((np.concatenate([own, second]), (rows, columns)), shape=(m, m))
    return matrix, log_determinant + 2.0 * float(np.log(left).sum())


def gaussian_terms(
    readings: Readings,
    case: Case,
    scatter: Floats,
    fixed: Floats | None = None,
    inner: Sequence[Floats] = (),
) -> GaussianTerms:
    """The terms of readings: a discrepancy of each channel, scatter of each run.

    The discrepancy that a case declares is always there, with the standard deviation that it
    states; what is estimated is beside it.

    scatter (m, 2): Change of each reading by one unit of scatter; see `scatter_columns`.
    fixed (m, k): Further columns of unit variance: errors that all rows share.
    inner: Columns (m, q) of further discrepancies, each with an amplitude of its own.
    """
    process = discrepancy_process(readings, case.discrepancy, least_eigenvalue=LEAST_EIGENVALUE)
    channels = len(readings.channels)
    parts, group = [process.columns], [process.channel]
    declared = (case.discrepancy.get(column(name)) for name in readings.channels)
    stated = [own is not None and own.amplitude(1.0) > 0.0 for own in declared]
    known = process.columns[:, np.asarray(stated, bool)[process.channel]]
    for own in (known, fixed):
        if own is not None and own.shape[1]:
            parts.append(own)
            group.append(np.full(own.shape[1], FIXED))
    first = channels + len(inner)
    for i, own in enumerate(inner):
        parts.append(own)
        group.append(np.full(own.shape[1], channels + i))
    if np.unique(readings.run[readings.row]).size > 1:
        parts.append(_by_run(readings, scatter))
        group.append(np.tile(first + np.arange(scatter.shape[1]), len(readings.runs)))
    return GaussianTerms(
        readings=readings,
        columns=np.concatenate(parts, axis=1),
        group=np.concatenate(group).astype(np.int64),
        kinds=(*(DISCREPANCY,) * first, *(SCATTER,) * scatter.shape[1]),
        usual=process.usual,
    )


def terms_like(
    terms: GaussianTerms, at: Hyperparameters, readings: Readings, scatter: Floats
) -> tuple[GaussianTerms, Hyperparameters]:
    """Noise and scatter of other readings, as that of known ones was found.

    scatter (m, 2): Change of each of these readings by one unit of scatter. Where the known
        readings are of one run, whose scatter nothing tells, there is none.
    """
    index = {name: i for i, name in enumerate(terms.readings.channels)}
    scale = terms.noise_scale(at)
    own = [np.log(scale[index[n]]) if n in index else 0.0 for n in readings.channels]
    several = bool(terms.scatter(at).any())
    columns = _by_run(readings, scatter) if several else np.zeros((len(readings), 0))
    kinds = (SCATTER,) * scatter.shape[1]
    new = GaussianTerms(
        readings=readings,
        columns=columns,
        group=np.tile(np.arange(len(kinds)), columns.shape[1] // len(kinds)),
        kinds=kinds,
        usual=np.ones(len(readings.channels)),
    )
    log = np.concatenate([at.log[terms.of_kind(SCATTER)], own])
    return new, Hyperparameters(log, present=False)


def _by_run(readings: Readings, scatter: Floats) -> Floats:
    """Columns (m, runs k) of a change (m, k) that each run has of its own."""
    run = readings.run[readings.row]
    return np.concatenate(
        [np.where((run == r)[:, None], scatter, 0.0) for r in range(len(readings.runs))], axis=1
    )


def scatter_columns(case: Case, readings: Readings) -> Floats:
    """Change of each reading by one unit of scatter of friction angle and of bearing, (m, 2).

    The bearing moduli scale together.
    """
    phi = float(case.soil.friction_angle)
    moduli = {name: float(getattr(case.soil, name)) for name in ("kc", "kphi")}
    units = constants.SCATTER_UNITS
    coordinates = [_distance("friction_angle", phi, units["friction_angle"])]
    coordinates += [
        _distance(name, value, units["bearing"] * value)
        for name, value in moduli.items()
        if value != 0.0
    ]
    jacobian = linearise(case, coordinates, np.zeros(len(coordinates)), readings).jacobian
    by_angle, by_bearing = jacobian[:, 0], jacobian[:, 1:].sum(axis=1)
    return np.asarray(np.nan_to_num(np.stack([by_angle, by_bearing], axis=1)))


def _distance(name: str, value: float, unit: float) -> Coordinate:
    """The coordinate of a soil parameter: its distance from a value, in a unit."""
    bounds = declared(Soil)[name]
    lower, upper = sorted(((bounds.lower - value) / unit, (bounds.upper - value) / unit))
    return Coordinate(name, bounds.unit, Prior(value, value + unit), lower=lower, upper=upper)
