"""Prior densities of hyperparameters and sizes, and the integrals with exact ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.fitting.coordinates import Coordinate
from soilml.inference import constants
from soilml.inference.gaussian_terms import (
    DISCREPANCY,
    SCATTER,
    GaussianTerms,
    Hyperparameters,
)
from soilml.numerics.prior import UNIFORM_PRECISION

LOG_2PI = float(np.log(2.0 * np.pi))
#: Precision that stands for the prior of a size until that is integrated exactly, in reference
#: sizes: so weak that it does not shrink the size.
WEAK_PRECISION = 0.1
#: Distance from a bound at which a coordinate counts as at it.
AT_BOUND = 1e-9


def prior_of_hyperparameters(
    terms: GaussianTerms, at: Hyperparameters
) -> tuple[float, Floats, Floats]:
    """-2 ln of the prior density of the logarithms, its gradient, and the curvature of half of it.

    Amplitudes of a discrepancy are exponential with a mean of one usual one, or with a small
    probability half-Cauchy; scatter is half-normal; the logarithm of a noise scale is normal.
    """
    value, gradient, curvature = 0.0, np.zeros_like(at.log), np.zeros_like(at.log)
    own = terms.of_kind(DISCREPANCY)
    if at.present:
        a, scale = np.exp(at.log[own]), constants.UNKNOWN_SCALE
        share = a / scale
        usual, tail = densities_of_amplitude(a)
        slope = (-usual - tail * 2.0 * share / scale / (1.0 + share**2)) / (usual + tail)
        value += float(-2.0 * (np.log(usual + tail) + at.log[own]).sum())
        gradient[own], curvature[own] = -2.0 * (1.0 + a * slope), np.minimum(a, 1.0)
    own = terms.of_kind(SCATTER)
    u = np.exp(at.log[own])
    value += float((u**2 - 2.0 * at.log[own] - np.log(2.0 / np.pi)).sum())
    gradient[own], curvature[own] = 2.0 * u**2 - 2.0, 2.0 * u**2
    s, std = at.log[terms.groups :], constants.LOG_NOISE_STD
    value += float((s**2).sum() / std**2 + 2.0 * len(s) * np.log(std))
    gradient[terms.groups :], curvature[terms.groups :] = 2.0 * s / std**2, std**-2
    return value, gradient, curvature


def densities_of_amplitude(a: Floats) -> tuple[Floats, Floats]:
    """Densities of amplitudes a (c,), in usual ones: of a usual error, and of an unknown cause."""
    q, scale = constants.UNKNOWN_CAUSE, constants.UNKNOWN_SCALE
    return (1.0 - q) * np.exp(-a), q * 2.0 / np.pi / scale / (1.0 + (a / scale) ** 2)


def unknown_cause(amplitude: Floats) -> float:
    """Probability that discrepancies of channels (c,), in usual ones, have an unknown cause."""
    usual, tail = densities_of_amplitude(amplitude)
    return 1.0 - float(np.prod(usual / (usual + tail)))


#: Distances from a peak, in its standard deviations, at which a density is summed; sizes of either
#: sign at which the density of a size changes.
_ABOUT = np.linspace(-8.0, 8.0, 97)
_SIZES = np.concatenate([-np.geomspace(30.0, 1e-3, 40), [0.0], np.geomspace(1e-3, 30.0, 40)])
#: Part of the marginal precision that the readings contribute at least.
LEAST_SHARE = 0.02
#: Farthest that a size without bounds is summed, in reference sizes.
FARTHEST = 20.0


def corrections_of_priors(
    coordinates: Sequence[Coordinate],
    x: Floats,
    precision: Floats,
    step: Floats,
    push: Floats,
    held: NDArray[np.bool_],
) -> Floats:
    r"""-2 ln of the factors (n,) by which exact priors, not normal, change Laplace's approximation.

    .. math:: I = \int p(x + t)\, e^{g t - \lambda t^2 / 2} dt

    between the bounds of the coordinate, with the marginal gradient g and precision lambda of the
    likelihood: the prior of a soil parameter is uniform, that of a size 1 / (|x| + e). A coordinate
    at a bound has the gradient that presses it there, and none that would lead away from it, since
    that was not fitted.
    """
    lower, upper = (np.asarray([getattr(c, e) for c in coordinates]) for e in ("lower", "upper"))
    of_size = np.asarray([c.of_candidate for c in coordinates], bool)
    standin = np.where(of_size, WEAK_PRECISION, UNIFORM_PRECISION)
    own = np.maximum(precision - standin, LEAST_SHARE * precision)
    inward = np.where(x <= lower + AT_BOUND, 1.0, -1.0)
    slope = np.where(held, np.where(push * inward < 0.0, push, 0.0), precision * step)
    low, high = lower - x, upper - x
    laplace = 0.5 * (LOG_2PI - np.log(precision)) + np.where(held, 0.0, 0.5 * precision * step**2)
    integral = _log_integral(slope, own, low, high)
    if of_size.any():
        each = (part[of_size] for part in (x, own, slope, lower, upper, held))
        integral[of_size] = _log_integral_of_size(*each)
    return np.asarray(-2.0 * (integral - laplace))


def _log_integral_of_size(
    x: Floats,
    precision: Floats,
    slope: Floats,
    lower: Floats,
    upper: Floats,
    held: NDArray[np.bool_],
) -> Floats:
    """ln of the integrals (n,) with the density of a size; see `corrections_of_priors`."""
    low, high, std = lower - x, upper - x, precision**-0.5
    peak = np.clip(slope / precision, low, high)
    pressed = held & (slope != 0.0)
    std[pressed] = np.minimum(std[pressed], 1.0 / np.abs(slope[pressed]))
    wide = np.linspace(np.maximum(low, -FARTHEST), np.minimum(high, FARTHEST), 33)
    points = [peak + np.outer(_ABOUT, std), wide, np.subtract.outer(_SIZES, x)]
    t = np.sort(np.clip(np.concatenate(points), low, high), axis=0)
    log = slope * t - 0.5 * precision * t**2
    log += log_density_of_size(x + t, (lower < 0.0) & (upper > 0.0))
    top = log.max(axis=0)
    return np.asarray(top + np.log(np.trapezoid(np.exp(log - top), t, axis=0)))


def _log_integral(slope: Floats, precision: Floats, low: Floats, high: Floats) -> Floats:
    """ln of the integrals (n,) of exp(slope t - precision t^2 / 2) between two bounds."""
    from scipy.special import log_ndtr

    root = np.sqrt(precision)
    a, b = low * root - slope / root, high * root - slope / root
    # where a is positive, mirrored, so that the tail is that below
    lower, upper = log_ndtr(np.where(a > 0.0, -b, a)), log_ndtr(np.where(a > 0.0, -a, b))
    inside = upper + np.log1p(-np.exp(np.minimum(lower - upper, -1e-12)))
    return np.asarray(0.5 * slope**2 / precision + 0.5 * (LOG_2PI - np.log(precision)) + inside)


def log_density_of_size(x: Floats, two_sided: bool | NDArray[np.bool_]) -> Floats:
    r"""ln of the density of sizes x (...), in reference sizes: 1 / [(|x| + e) ln(1 + X / e)] to X.

    Beyond X it falls with further powers of the size.
    """
    small, large = constants.SMALLEST_SIZE, constants.LARGEST_SIZE
    size = np.abs(x) + small
    span = np.log1p(large / small) * np.where(two_sided, 2.0, 1.0)
    beyond = np.maximum(np.log(size / (large + small)), 0.0)
    return np.asarray(-np.log(span * size) - constants.TAIL_POWER * beyond)
