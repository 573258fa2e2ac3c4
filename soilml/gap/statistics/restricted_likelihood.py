"""The restricted likelihood of residuals as a function of their variance components."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.fitting.readings import Readings

Floats = NDArray[np.float64]

#: Prior standard deviations of the run-to-run variation, in units of `RUN_EFFECT_UNITS` in
#: `soilml.gap.statistics.reml_covariance`, and of the logarithm of a channel's noise scale.
RUN_EFFECT_PRIOR_STD, LOG_NOISE_SCALE_PRIOR_STD = 1.0, 0.3


@dataclass(frozen=True)
class RestrictedLikelihood:
    r"""The restricted likelihood at one autocorrelation, from sums over channels and runs.

    The noise of a channel is independent of that of the others, and the noise of a run of that of
    other runs. With C the noise's correlation and D = diag(s_c sigma) C diag(s_c sigma),

    .. math::
        V = D + \sum_r U_r \mathrm{diag}(\tau^2) U_r^T, \qquad
        Y^T V^{-1} Y = Y^T D^{-1} Y - \sum_r B_r^T M_r B_r, \qquad
        M_r = T (I + T G_r T)^{-1} T

    with U_r the columns of the run-to-run variation in the rows of run r, G_r = U_r^T D^{-1} U_r,
    B_r = U_r^T D^{-1} Y and T = diag(tau): only matrices of the size of Y^T Y are factored for each
    set of variance components.

    References
    ----------
    Woodbury's identity; Searle, Casella and McCulloch, Variance Components, 1992, section 6.6.
    """

    fixed: int  # q, number of fixed effects; Y has q + 1 columns, the last one the residuals
    cross_products: Floats  # (channels, q + 1, q + 1), Y^T D^-1 Y of each channel at scale 1
    run_products: Floats  # (channels, runs, 2, q + 1), U_r^T D^-1 Y
    run_squares: Floats  # (channels, runs, 2, 2), U_r^T D^-1 U_r
    log_determinant: float  # of D at scale 1
    counts: Floats  # (channels,), readings of each channel

    def objective(self, scale: Floats, run_effects: Floats) -> Floats:
        """-2 log posterior, (trials,), at noise scales (trials, channels) and run effects.

        `run_effects`, (trials, 2), are the standard deviations from run to run.
        """
        weight = scale**-2.0
        products = np.einsum("tc,cij->tij", weight, self.cross_products)
        by_run = np.einsum("tc,crki->trki", weight, self.run_products)
        squares = np.einsum("tc,crkl->trkl", weight, self.run_squares)
        tau = run_effects[:, None, :]
        inner = np.eye(2) + tau[..., :, None] * squares * tau[..., None, :]
        scaled = tau[..., None] * by_run
        products = products - np.einsum("trki,trkj->tij", scaled, np.linalg.solve(inner, scaled))
        value = self.log_determinant + 2.0 * np.log(scale) @ self.counts
        value = value + np.log(np.linalg.det(inner)).sum(axis=1)
        factor = np.linalg.cholesky(products[:, : self.fixed, : self.fixed])
        explained = np.linalg.solve(factor, products[:, : self.fixed, self.fixed :])[..., 0]
        left = products[:, self.fixed, self.fixed] - (explained**2).sum(axis=1)
        pivots = np.diagonal(factor, axis1=1, axis2=2)
        value = value + 2.0 * np.log(pivots).sum(axis=1) + np.maximum(left, 0.0)
        value = value + ((np.log(scale) / LOG_NOISE_SCALE_PRIOR_STD) ** 2).sum(axis=1)
        return np.asarray(value + ((run_effects / RUN_EFFECT_PRIOR_STD) ** 2).sum(axis=1))


def restricted_likelihood(
    readings: Readings,
    columns: Floats,
    residual: Floats,
    basis: Floats,
    autocorrelation: float,
) -> RestrictedLikelihood:
    """The restricted likelihood of residuals (m,) with fixed effects `basis` (m, q).

    `columns`, (m, 2), are the changes of the readings by a unit of run-to-run variation.
    """
    everything = np.column_stack([columns, basis, residual]) / readings.std[:, None]
    white, log_determinant = whiten_series(readings, everything, autocorrelation)
    run_columns, y = white[:, :2], white[:, 2:]
    run = readings.run[readings.row]
    channels, runs, size = len(readings.channels), len(readings.runs), y.shape[1]
    cross_products = np.zeros((channels, size, size))
    run_products = np.zeros((channels, runs, 2, size))
    run_squares = np.zeros((channels, runs, 2, 2))
    for c in range(channels):
        in_channel = readings.channel == c
        cross_products[c] = y[in_channel].T @ y[in_channel]
        for r in range(runs):
            rows = in_channel & (run == r)
            run_products[c, r] = run_columns[rows].T @ y[rows]
            run_squares[c, r] = run_columns[rows].T @ run_columns[rows]
    counts = np.bincount(readings.channel, minlength=channels).astype(np.float64)
    log_determinant += 2.0 * float(np.log(readings.std).sum())
    return RestrictedLikelihood(
        basis.shape[1], cross_products, run_products, run_squares, log_determinant, counts
    )


def whiten_series(
    readings: Readings, columns: Floats, autocorrelation: float
) -> tuple[Floats, float]:
    r"""Columns (m, k) made independent along each run and channel; log determinant of C.

    Samples of a first-order autoregressive series depend on the sample before alone:

    .. math:: w_i = \frac{y_i - \rho^d y_{i-1}}{\sqrt{1 - \rho^{2 d}}}

    with d the number of samples between the two.
    """
    if autocorrelation == 0.0:
        return columns, 0.0
    run, sample = readings.run[readings.row], readings.order[readings.row]
    key = np.lexsort((sample, readings.channel, run))
    follows = (np.diff(run[key]) == 0) & (np.diff(readings.channel[key]) == 0)
    lag = np.where(follows, np.diff(sample[key]), 1)
    correlation = np.concatenate([[0.0], np.where(follows, autocorrelation**lag, 0.0)])[:, None]
    ordered = columns[key]
    before = np.concatenate([np.zeros_like(ordered[:1]), ordered[:-1]])
    variance = 1.0 - correlation**2
    white = np.empty_like(columns)
    white[key] = (ordered - correlation * before) / np.sqrt(variance)
    return white, float(np.log(variance).sum())
