"""Covariance of the readings by restricted maximum likelihood.

Three sources of variation: sensor noise, soil parameters that differ from run to run, and
autocorrelation of neighbouring samples of a run.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.numerics.prior import Prior
from soilml.numerics.subspaces import column_space
from soilml.parameters import declared
from soilml.physics.soils import Soil

#: One unit of run-to-run variation: half a degree of friction angle, 5 % of the bearing moduli.
RUN_EFFECT_UNITS = {"friction_angle": np.deg2rad(0.5), "bearing": 0.05}
#: With fewer runs than this the run-to-run variation cannot be estimated; it is then assumed to be
#: at least this many units.
FEW_RUNS, MIN_RUN_EFFECT = 6, 0.8
#: Values of the run-to-run standard deviations that are tried, in units: none, then steps of about
#: a factor 1.5, which change the objective by about 1 near its minimum; 5 units are 2.5 deg.
RUN_EFFECT_GRID = (0.0, 0.25, 0.5, 0.8, 1.2, 1.8, 3.0, 5.0)
#: Factors by which a channel's noise scale is multiplied in each step of the search. The uneven
#: spacing lets two sweeps reach scales between 1 and 3 without returning to the same values.
#: Scales below 1 are excluded: the declared noise is a lower bound.
NOISE_SCALE_FACTORS = (0.93, 1.0, 1.15, 1.32, 1.75)
#: Sweeps of the coordinate search; the covariance is estimated again after each search for effects.
SWEEPS = 2
#: Correlations of neighbouring samples that are tried: correlation lengths of 0.7, 1.4, 2.8, 6 and
#: 20 samples, which a run of usual length can distinguish.
AUTOCORRELATION_GRID = (0.25, 0.5, 0.7, 0.85, 0.95)
#: An autocorrelation is accepted if it lowers the objective, -2 log posterior, by this much: the
#: penalty of Akaike's criterion for one parameter.
AUTOCORRELATION_PENALTY = 2.0
#: Pairs of neighbouring samples, and standard deviations above its expectation of the sum of their
#: products, from which an autocorrelation is estimated at all.
MIN_PAIRS, AUTOCORRELATION_SIGMA = 8, 2.0
#: Directions of the fixed effects whose whitened singular value is below these, relative to the
#: largest and in standard deviations, are too weak to absorb noise and cost no degree of freedom.
FIXED_EFFECT_TOLERANCES = {"relative_tolerance": 1e-3, "absolute_tolerance": 0.3}


@dataclass(frozen=True)
class VarianceComponents:
    """Estimated noise scales, run-to-run standard deviations and autocorrelation."""

    noise_scale: Floats  # (channels,) factor on the declared noise
    friction_angle_std: float  # rad, from run to run
    bearing_std: float  # relative, from run to run
    autocorrelation: float  # correlation of neighbouring samples of a run
    degrees_of_freedom: float = 1.0  # from which the noise was estimated, if it was

    @staticmethod
    def usual(
        readings: Readings, *, units: float = 1.0, autocorrelation: float = 0.0
    ) -> VarianceComponents:
        """The declared noise, and so many units of run-to-run variation."""
        return VarianceComponents(
            noise_scale=np.ones(len(readings.channels)),
            friction_angle_std=units * RUN_EFFECT_UNITS["friction_angle"],
            bearing_std=units * RUN_EFFECT_UNITS["bearing"],
            autocorrelation=autocorrelation,
        )


@dataclass(frozen=True)
class Covariance:
    """The covariance of all readings, (m, m), and the inverse of its Cholesky factor."""

    matrix: Floats
    whiten: Floats
    components: VarianceComponents

    @property
    def std(self) -> Floats:
        """Standard deviation of each reading, (m,)."""
        return np.asarray(np.sqrt(np.diag(self.matrix)))

    def of_readings(self, selected: NDArray[np.bool_], run: NDArray[np.int64]) -> Covariance:
        """The covariance of the selected readings, of which each has a run (m,)."""
        matrix = self.matrix[np.ix_(selected, selected)]
        return Covariance(matrix, _whitening_matrix(matrix, run[selected]), self.components)


def run_effect_columns(case: Case, readings: Readings) -> Floats:
    """Change of each reading by one unit of run-to-run variation, (m, 2).

    The columns are those of friction angle and of the bearing moduli, which scale together.
    """
    phi = float(case.soil.friction_angle)
    moduli = {name: float(getattr(case.soil, name)) for name in ("kc", "kphi")}
    coordinates = [_unit_coordinate("friction_angle", phi, RUN_EFFECT_UNITS["friction_angle"])]
    coordinates += [
        _unit_coordinate(name, value, RUN_EFFECT_UNITS["bearing"] * value)
        for name, value in moduli.items()
        if value != 0.0
    ]
    jacobian = linearise(case, coordinates, np.zeros(len(coordinates)), readings).jacobian
    by_angle, by_bearing = jacobian[:, 0], jacobian[:, 1:].sum(axis=1)
    return np.asarray(np.nan_to_num(np.stack([by_angle, by_bearing], axis=1)))


def _unit_coordinate(name: str, value: float, unit: float) -> Coordinate:
    """The coordinate of a soil parameter: its distance from a value, in a unit."""
    bounds = declared(Soil)[name]
    lower, upper = sorted(((bounds.lower - value) / unit, (bounds.upper - value) / unit))
    return Coordinate(name, bounds.unit, Prior(value, value + unit), lower=lower, upper=upper)


def assemble_covariance(
    readings: Readings, columns: Floats, components: VarianceComponents
) -> Covariance:
    """The covariance of readings with their declared noise under given variance components."""
    std = readings.std * components.noise_scale[readings.channel]
    matrix = np.outer(std, std) * _noise_correlation(readings, components.autocorrelation)
    run_effects = np.asarray(
        [
            components.friction_angle_std / RUN_EFFECT_UNITS["friction_angle"],
            components.bearing_std / RUN_EFFECT_UNITS["bearing"],
        ]
    )
    matrix += _same_run_indicator(readings) * ((columns * run_effects**2) @ columns.T)
    return Covariance(matrix, _whitening_matrix(matrix, readings.run[readings.row]), components)


def _whitening_matrix(matrix: Floats, run: NDArray[np.int64]) -> Floats:
    """Inverse of the Cholesky factor of a covariance without correlation between runs, (m, m).

    Neither the factor nor its inverse mixes runs, so that each run has its own block in them.
    """
    whiten = np.zeros_like(matrix)
    for number in np.unique(run):
        block = np.ix_(run == number, run == number)
        whiten[block] = np.linalg.inv(np.linalg.cholesky(matrix[block]))
    return whiten


def estimate_covariance(
    readings: Readings,
    columns: Floats,
    residual: Floats,
    space: Floats,
    smooth: Floats | None = None,
) -> Covariance:
    r"""Estimate the variance components by restricted maximum likelihood with weak priors.

    .. math::
        -2 \ln p = \ln|V| + \ln|X^T V^{-1} X| + r^T P r + \text{prior}, \quad
        V = D_\rho + \sum_k \tau_k^2 J_k J_k^T

    columns (m, 2): J, from `run_effect_columns`.
    residual (m,): r, the residuals of any fit.
    space (m, q): X, all that soil, effects and smooth functions could explain: the fixed effects.
        Only the component of the residuals outside its span contributes to the estimate.
    smooth (m, k): Smooth functions beside it, of channels with few readings.

    References: Patterson and Thompson, Biometrika 58, 1971.
    """
    std = readings.std[:, None]
    basis = fixed_effects(space / std, None if smooth is None else smooth / std) * std
    grid = _run_effect_grid(len(readings.runs))
    best, lowest = _coordinate_search(
        restricted_likelihood(readings, columns, residual, basis, 0.0), 0.0, grid
    )
    if _is_autocorrelated(readings, residual, basis):
        for autocorrelation in AUTOCORRELATION_GRID:
            likelihood = restricted_likelihood(readings, columns, residual, basis, autocorrelation)
            components, value = _coordinate_search(likelihood, autocorrelation, grid)
            if value < lowest - AUTOCORRELATION_PENALTY:
                best, lowest = components, value
    degrees_of_freedom = max(float(len(readings) - basis.shape[1]), PRIOR_DEGREES)
    best = replace(best, degrees_of_freedom=degrees_of_freedom)
    return assemble_covariance(readings, columns, best)


def fixed_effects(space: Floats, smooth: Floats | None) -> Floats:
    """Orthonormal basis of the whitened directions (m, q) and smooth functions (m, k) beside them.

    The functions are kept beside directions of any length. A small part of a signature is too weak
    to absorb noise, but what is smooth is no noise at any size.
    """
    basis = column_space(space, **FIXED_EFFECT_TOLERANCES)
    if smooth is None:
        return basis
    beside = smooth - basis @ (basis.T @ smooth)
    return np.hstack([basis, column_space(beside, **FIXED_EFFECT_TOLERANCES)])


def _run_effect_grid(runs: int) -> tuple[float, ...]:
    """Run-to-run standard deviations to try: none for one run, assumed ones for few runs."""
    if runs < 2:
        return (0.0,)
    if runs < FEW_RUNS:
        return tuple(t for t in RUN_EFFECT_GRID if t >= MIN_RUN_EFFECT)
    return RUN_EFFECT_GRID


def _coordinate_search(
    likelihood: RestrictedLikelihood, autocorrelation: float, grid: tuple[float, ...]
) -> tuple[VarianceComponents, float]:
    """Minimise over run effects and noise scales in turn, at one autocorrelation."""
    scale, run_effects = np.ones((1, len(likelihood.counts))), np.full((1, 2), grid[0])
    value = float(likelihood.objective(scale, run_effects)[0])
    for _ in range(SWEEPS):
        for k in range(2):
            trials = _with_column(run_effects, k, np.asarray(grid))
            values = likelihood.objective(np.repeat(scale, len(trials), axis=0), trials)
            best = int(np.argmin(values))
            value, run_effects = float(values[best]), trials[best : best + 1]
        for k in range(scale.shape[1]):
            candidates = np.asarray([1.0, *(scale[0, k] * f for f in NOISE_SCALE_FACTORS)])
            trials = _with_column(scale, k, np.unique(candidates[candidates >= 1.0]))
            values = likelihood.objective(trials, np.repeat(run_effects, len(trials), axis=0))
            best = int(np.argmin(values))
            value, scale = float(values[best]), trials[best : best + 1]
    components = VarianceComponents(
        scale[0],
        float(run_effects[0, 0] * RUN_EFFECT_UNITS["friction_angle"]),
        float(run_effects[0, 1] * RUN_EFFECT_UNITS["bearing"]),
        autocorrelation,
    )
    return components, value


def _is_autocorrelated(readings: Readings, residual: Floats, basis: Floats) -> bool:
    """Whether neighbouring residuals of a run are more similar than independent noise explains."""
    white, q = residual / readings.std, np.linalg.qr(basis / readings.std[:, None])[0]
    projected = white - q @ (q.T @ white)
    run = readings.run[readings.row]
    sample = readings.order[readings.row]
    key = np.lexsort((sample, readings.channel, run))
    follows = (np.diff(run[key]) == 0) & (np.diff(readings.channel[key]) == 0)
    follows &= np.diff(sample[key]) == 1
    pairs = projected[key][:-1][follows] * projected[key][1:][follows]
    if pairs.size < MIN_PAIRS:
        return False
    # projecting out the fixed effects correlates neighbours negatively: correct for it
    expected = -float(np.sum((q @ q.T)[key[:-1][follows], key[1:][follows]]))
    std = float(np.mean(projected**2)) * np.sqrt(pairs.size)
    excess = pairs.sum() - expected * float(np.mean(projected**2))
    return bool(excess > AUTOCORRELATION_SIGMA * std)


def _same_run_indicator(readings: Readings) -> Floats:
    """1 where two readings are of one run, else 0, (m, m)."""
    run = readings.run[readings.row]
    return np.asarray(run[:, None] == run, dtype=np.float64)


def _noise_correlation(readings: Readings, autocorrelation: float) -> Floats:
    """First-order autoregressive correlation within each run and channel, (m, m)."""
    if autocorrelation == 0.0:
        return np.eye(len(readings))
    channel = readings.channel
    same_series = _same_run_indicator(readings) * (channel[:, None] == channel)
    sample = readings.order[readings.row].astype(np.float64)
    lag = np.abs(sample[:, None] - sample)
    return np.asarray(same_series * autocorrelation**lag)


def _with_column(row: Floats, index: int, values: Floats) -> Floats:
    """The row (1, k) repeated with each of the values in one of its columns, (values, k)."""
    changed = np.repeat(row, len(values), axis=0)
    changed[:, index] = values
    return changed


#: Prior standard deviations of the run-to-run variation, in units of `RUN_EFFECT_UNITS` in
#: `soilml.gap.evidence.covariance`, and of the logarithm of a channel's noise scale.
RUN_EFFECT_PRIOR_STD, LOG_NOISE_SCALE_PRIOR_STD = 1.0, 0.3
#: Degrees of freedom that know a noise scale as well as its prior does, the least that are counted:
#: the logarithm of a scale from k residuals has a standard deviation of sqrt(1 / (2 k)).
PRIOR_DEGREES = 0.5 / LOG_NOISE_SCALE_PRIOR_STD**2


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

    References: Woodbury's identity; Searle, Casella and McCulloch, Variance Components, 1992,
    section 6.6.
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
    readings: Readings, columns: Floats, residual: Floats, basis: Floats, autocorrelation: float
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
        fixed=basis.shape[1],
        cross_products=cross_products,
        run_products=run_products,
        run_squares=run_squares,
        log_determinant=log_determinant,
        counts=counts,
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
