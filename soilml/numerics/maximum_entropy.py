"""Maximum-entropy weights: those nearest to given weights of samples that have given moments.

The weights are tilted by the exponential of linear and quadratic terms, whose multipliers Newton's
method finds on the convex dual.
"""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.quantiles import effective_size

#: Most Newton steps on samples, and the error of the standardised moments that is accepted.
SAMPLE_STEPS, SAMPLE_TOLERANCE = 60, 1e-4
#: Effective sample size below which a step is refused: no density in the range has such moments.
LEAST_EFFECTIVE_SIZE = 200.0
HALVINGS = 12  # Halvings of a Newton step that does not lower the dual


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
