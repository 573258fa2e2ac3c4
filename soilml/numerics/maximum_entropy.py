"""Maximum-entropy densities: the one nearest to a base density that has given moments.

Both routines tilt a base density by the exponential of linear and quadratic terms and find the
multipliers by Newton's method on the convex dual. `prior_quantiles` is for one parameter on a grid
of its prior, `moment_matched_weights` for weighted samples of several.
"""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.prior import Prior
from soilml.numerics.quantiles import effective_size

#: Grid points along the prior: their spacing, 0.05 % of the range, is the least std resolved.
GRID_POINTS = 2000
#: Most Newton steps on the grid, the largest change of a multiplier in one, and the error of the
#: standardised moments that is accepted.
GRID_STEPS, LARGEST_STEP, GRID_TOLERANCE = 100, 4.0, 1e-6
#: Most Newton steps on samples, and the error of the standardised moments that is accepted.
SAMPLE_STEPS, SAMPLE_TOLERANCE = 60, 1e-4
#: Effective sample size below which a step is refused: no density in the range has such moments.
LEAST_EFFECTIVE_SIZE = 200.0
HALVINGS = 12  # Halvings of a Newton step that does not lower the dual


def prior_quantiles(prior: Prior, mean: float, std: float, probability: Floats) -> Floats:
    r"""Quantiles, as fractions of the prior, of the maximum-entropy density with a mean and std.

    .. math:: p(x) \propto p_0(x) \exp(a x + b x^2)

    is the density nearest to the prior p_0 that has this mean and std; it stays inside the prior,
    and equals the prior where mean and std are the prior's. A mean at a bound of the prior with a
    wide std, which no density has, gives the nearest density that was reached.

    prior: Prior of the parameter.
    mean, std: Moments in the parameter's unit.
    probability: Probabilities (...) at which the quantile function is evaluated.

    References: Jaynes, Physical Review 106, 1957.
    """
    fraction = (np.arange(GRID_POINTS) + 0.5) / GRID_POINTS
    value = prior.at(fraction)
    x = (value - mean) / max(std, (prior.upper - prior.lower) / GRID_POINTS)
    features = np.stack([x, x**2 - 1.0])  # their expectations are to be zero
    multipliers = np.zeros(2)
    for _ in range(GRID_STEPS):
        weights = _tilted(1.0, multipliers @ features)[1]
        moments = features @ weights
        hessian = (features * weights) @ features.T - np.outer(moments, moments)
        step = np.linalg.solve(hessian + 1e-9 * np.eye(2), -moments)
        damping = min(1.0, LARGEST_STEP / float(np.abs(step).max() + 1e-300))
        multipliers = multipliers + step * damping
        if float(np.abs(moments).max()) < GRID_TOLERANCE:
            break
    cumulative = np.cumsum(_tilted(1.0, multipliers @ features)[1])
    edges = np.concatenate([[0.0], cumulative])
    return np.asarray(np.interp(probability, edges, np.arange(GRID_POINTS + 1) / GRID_POINTS))


def moment_matched_weights(weights: Floats, white: Floats) -> Floats:
    r"""Weights (n,) under which standardised samples (n, p) have mean 0 and covariance 1.

    .. math:: w_i' \propto w_i \exp(\lambda^\top f_i), \quad
        f = (x, \; x x^\top - I), \quad
        \lambda = \arg\min \log \textstyle\sum_i w_i \exp(\lambda^\top f_i)

    Moments that no weights of these samples have are met as nearly as `LEAST_EFFECTIVE_SIZE`
    allows.

    weights: Weights (n,) of the samples, which sum to one.
    white: Samples (n, p), less the wanted mean and divided by the Cholesky factor of the
        covariance.

    References: Jaynes, Physical Review 106, 1957.
    """
    features = _moment_features(white)
    multipliers = np.zeros(features.shape[1])
    dual, tilted = _tilted(weights, features @ multipliers)
    tilted = weights
    for _ in range(SAMPLE_STEPS):
        moments = np.tensordot(tilted, features, axes=1)
        if np.abs(moments).max() < SAMPLE_TOLERANCE:
            break
        centred = features - moments
        hessian = (centred.T * tilted) @ centred
        ridge = 1e-9 * np.trace(hessian) * np.eye(len(moments))
        step = np.linalg.solve(hessian + ridge, moments)
        for length in 0.5 ** np.arange(HALVINGS):
            trial = multipliers - length * step
            trial_dual, trial_weights = _tilted(weights, features @ trial)
            if trial_dual < dual and effective_size(trial_weights) >= LEAST_EFFECTIVE_SIZE:
                dual, tilted, multipliers = trial_dual, trial_weights, trial
                break
        else:
            break
    return tilted


def _moment_features(white: Floats) -> Floats:
    """First and second moments of each sample less their targets, (n, p + p (p + 1) / 2)."""
    p = white.shape[1]
    i, j = np.triu_indices(p)
    features = np.hstack([white, white[:, i] * white[:, j]])
    return np.asarray(features - np.concatenate([np.zeros(p), (i == j).astype(float)]))


def _tilted(weights: Floats | float, exponent: Floats) -> tuple[float, Floats]:
    """Log of the sum of weights times exp(exponent), and these products over their sum (n,)."""
    top = float(exponent.max())
    products = np.asarray(weights * np.exp(exponent - top))
    total = float(products.sum())
    if not total > 0.0:
        return float("inf"), products
    return top + float(np.log(total)), np.asarray(products / total)
