"""Integral of a posterior density between the bounds of the soil's priors."""

from __future__ import annotations

from math import erfc, exp, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from soilml.fitting.coordinates import SoilCoordinate
from soilml.fitting.least_squares import Solution
from soilml.numerics.prior import UNIFORM_PRECISION

Floats = NDArray[np.float64]

#: Distance from a bound, as a fraction of the prior, at which a coordinate is held by it.
AT_BOUND = 1e-6
#: Smallest precision by the likelihood alone: the likelihood is flat over the prior.
FLAT = 1e-3
#: Distance beyond a bound, in standard deviations, from which an asymptotic series is used.
FAR = 6.0


def outside_bounds(fit: Solution, gradient: Floats, curvature: Floats) -> float:
    r"""-2 ln of the factor that the bounds of the soil's priors put on Laplace's approximation.

    Laplace's approximation integrates a normal density over the whole line, with the variance of
    the uniform prior in it. Each soil coordinate t is instead integrated where its prior is:

    .. math:: I = \int_0^1 e^{g (t - x) - \lambda (t - x)^2 / 2} dt

    with the gradient g and the precision lambda of the likelihood at the fit x, all other
    coordinates free. Correlations of these integrals are neglected. An explanation that presses
    the soil against its priors counts for less.

    Parameters
    ----------
    gradient, curvature : arrays (p,), (p, p)
        Of ln p at the fit, with further effects after the fit's own coordinates.
    """
    low = np.asarray([c.lower for c in fit.coordinates])
    high = np.asarray([c.upper for c in fit.coordinates])
    held = (fit.x <= low + AT_BOUND) | (fit.x >= high - AT_BOUND)
    movable = np.concatenate([~held, np.ones(len(gradient) - len(held), dtype=np.bool_)])
    value = 0.0
    for i, c in enumerate(fit.coordinates):
        if not isinstance(c, SoilCoordinate):
            continue
        free = movable.copy()
        free[i] = True
        inverse = np.linalg.inv(curvature[np.ix_(free, free)])
        own = int(np.count_nonzero(free[:i]))
        precision = 1.0 / inverse[own, own]
        step = float(inverse[own] @ gradient[free])
        x = float(fit.x[i])
        integral = _log_integral(
            precision * step, max(precision - UNIFORM_PRECISION, FLAT), low[i] - x, high[i] - x
        )
        laplace = 0.5 * log(2.0 * pi / precision) + (0.0 if held[i] else 0.5 * precision * step**2)
        value -= 2.0 * (integral - laplace)
    return value


def _log_integral(gradient: float, precision: float, low: float, high: float) -> float:
    """Logarithm of the integral of exp(gradient t - precision t^2 / 2) between two bounds."""
    root = sqrt(precision)
    optimum = gradient / precision
    a, b = (low - optimum) * root, (high - optimum) * root
    if a > 0.0:  # mirrored, so that the bound next to the optimum is the upper one
        a, b, low, high = -b, -a, -high, -low
        gradient = -gradient
    scale = 0.5 * log(2.0 * pi / precision)
    if b >= 0.0:
        share = 0.5 * (erfc(-b / sqrt(2.0)) - erfc(-a / sqrt(2.0)))
        return 0.5 * precision * optimum**2 + scale + log(share)
    at_bound = gradient * high - 0.5 * precision * high**2
    return at_bound + scale + log(_scaled_tail(-b) - _scaled_tail(-a) * exp(0.5 * (b**2 - a**2)))


def _scaled_tail(p: float) -> float:
    """Probability beyond p standard deviations, times exp(p^2 / 2)."""
    if p > FAR:
        return (1.0 - 1.0 / p**2 + 3.0 / p**4) / (p * sqrt(2.0 * pi))
    return 0.5 * erfc(p / sqrt(2.0)) * exp(0.5 * p**2)
