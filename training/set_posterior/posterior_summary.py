"""Outputs of a set posterior as nodes of a graph: mean, covariance, interval, flags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.onboard.estimate import EDGE_STDS
from soilml.onboard.set_contract import LEAST_SHARE_IN_RANGE, SET_PREFIX
from soilml.quantities import NOT_IDENTIFIED_ABOVE
from training.onnx_graph.value import (
    Value,
    absolute,
    composite,
    concat,
    constant,
    exp,
    gemm,
    maximum,
    minimum,
    sqrt,
    where,
)
from training.set_posterior.families.wheel_family import ContextValues, WheelFamily

INTERVAL = (0.05, 0.95)  # Probabilities of the ends of the interval
#: Distances from the mean, in standard deviations, at which the distribution function is evaluated.
#: The 5 % quantile of a normal distribution lies 1.64 below the mean, that of a uniform one 1.56,
#: and those of an exponential one 0.95 below and 2.0 above; the grid leaves room on both sides of
#: them. All are multiples of their spacing.
SPACING = 0.25
DISTANCES = np.arange(0.5, 3.3, SPACING)
#: Largest sum of squared weights that is taken into account: one point alone has 1.
LARGEST_SHARE = 0.95
LEAST_SHARE = 1e-6  # Least share of the sample between two grid points that is divided by
#: Beyond the largest calibrated number of readings n the limit grows by 1 + 3 / sqrt(n) a reading:
#: that of a chi-squared distribution with n degrees of freedom is n + 3 sqrt(n) to 3 standard
#: deviations, roughly, and a straight line through it lies above it.
MARGIN = 3.0


@dataclass(frozen=True)
class MisfitLimits:
    """Largest accepted misfit of a set by number of readings, both rising."""

    readings: Floats
    misfit: Floats

    def of_set(self, counts: Value) -> tuple[Value, Value]:
        """Largest misfit of sound sets, and whether rows suffice, (1,) each, as nodes of a graph.

        The limit is linear in the logarithm of the number of readings between the calibrated
        numbers. There must be readings, and at least half of the rows in range.

        counts: Readings in the system, rows, and rows in range, (3,): whole numbers.
        """
        readings, rows, rows_in_range = counts.split([1, 1, 1], axis=0)
        last = int(self.readings[-1])
        numbers = np.maximum(np.arange(last + 1), self.readings[0])
        table = np.interp(np.log(numbers), np.log(self.readings), self.misfit)
        place = readings.clip(0.0, float(last)).astype(np.int32)
        interpolated = constant(counts.graph, table).node("Gather", place)
        beyond = maximum(readings - float(last), 0.0)
        limit = interpolated + beyond * (1.0 + MARGIN / np.sqrt(last))
        enough_in_range = rows_in_range >= rows * LEAST_SHARE_IN_RANGE
        any_reading = readings > 0.5  # a count in float32
        return limit, enough_in_range & any_reading


def add_quantiles(deviations: Value, std: Value, weights: Value) -> Value:
    r"""The quantiles (2, q) at `INTERVAL` of q deviations from a mean.

    The weighted distribution function F is evaluated at multiples :math:`g_i` of the spacing h, and
    inverted by linear interpolation. The weight of a sample at :math:`d_j` is shared by the grid
    points around it:

    .. math:: F(g_i) = \sum_j w_j \left[\frac{1}{2} + \frac{g_i - d_j}{h}\right]_0^1

    A sample that counted as a whole on either side of a grid point would move the quantile, by a
    hundredth of a standard deviation and more, when rounding takes it to the other side. Below the
    quantile at probability alpha lie segments that are passed as a whole, and one that is passed in
    part:

    .. math:: Q(\alpha) = g_0 + \sum_i h
        \left[\frac{\alpha - F(g_i)}{F(g_{i+1}) - F(g_i)}\right]_0^1

    A quantile off the grid is at its end. ONNX has no weighted quantile, and sorting each
    parameter's samples would take longer than the rest of the graph.

    deviations: Deviations from the mean, (q, n).
    std: Their standard deviations, (q,).
    weights: Weights (1, n) with sum 1.
    """
    given = {"deviations": deviations, "std": std, "weights": weights}
    for name, numbers in (("grid", GRID), ("spacing", [SPACING]), ("probabilities", INTERVAL)):
        given[name] = constant(std.graph, numbers, name=name)  # for C, which has a template
    return composite("Quantiles", ["ends"], _quantiles, **given)[0]


#: Multiples of the spacing, around the mean.
GRID = np.concatenate([-DISTANCES[::-1], DISTANCES]) / SPACING


def _quantiles(deviations: Value, std: Value, weights: Value, **_: Value) -> list[Value]:
    segments, spacing = len(DISTANCES) - 1, std * SPACING
    relative = (deviations / spacing.reshape(-1, 1)).reshape(0, 1, -1)
    below = ((GRID + 0.5)[:, None] - relative).clip(0.0, 1.0)
    distribution = (below @ weights.reshape(-1, 1)).reshape(0, len(GRID))
    ends = []
    for begin, probability in zip((0, len(DISTANCES)), INTERVAL, strict=True):
        low, high = (distribution.columns(begin + k, begin + k + segments) for k in (0, 1))
        passed = (probability - low) / maximum(high - low, LEAST_SHARE)
        ends.append(passed.clip(0.0, 1.0).sum(axis=1, keepdims=False) + float(GRID[begin]))
    return [concat(ends, axis=0).reshape(2, -1) * spacing]


ZERO_FACTOR = 1e-30  # Stands for a factor of zero, of which the logarithm is taken
#: Quantiles of the prior, in equal steps of probability, over which its moments are computed.
PRIOR_POINTS = 4096


def add_posterior_outputs(
    family: WheelFamily,
    order: tuple[int, ...],
    context: ContextValues,
    sample: Sequence[Value],
    consistency: tuple[Value, Value],
    prefix: str,
    few_points: bool = False,
) -> None:
    r"""Add the outputs, each named `<prefix>set_<name>`, from the moments of the weighted sample.

    .. math:: \mu = \sum_i w_i \theta_i, \qquad
        \Sigma = \sum_i w_i (\theta_i - \mu) (\theta_i - \mu)^T

    A set without enough rows in range gets the prior. Of a set that no soil explains, the sample
    is that with the noise that explains it, and the flag is false.

    order: Of the axes in the points.
    sample: Points (1 + p, n), weights (1, n) with sum 1, and least misfit (1,).
    consistency: Of `MisfitLimits.of_set`.
    few_points: Whether the covariance also has the error of a mean of few points, see
        `variance_of_few_points`.
    """
    q, (points, weights, misfit) = family.targets, sample
    # onnxruntime takes half the time for one row times a matrix than for a matrix times one column
    value = _parameters(family, order, points)
    mean = gemm(weights, value, transpose_b=True)  # (1, q)
    deviation = value - mean.reshape(q, 1)
    mean = mean.reshape(q)
    covariance = gemm(deviation * weights, deviation, transpose_b=True)
    variance = (covariance * np.eye(q)).sum(axis=0, keepdims=False)
    std = sqrt(variance)
    interval = add_quantiles(deviation, std, weights)
    if few_points:
        factor = variance_of_few_points(weights)
        root = sqrt(factor)
        covariance, std, interval = covariance * factor, std * root, interval * root
    interval = mean + interval
    limit, enough = consistency
    consistent = enough & (misfit <= limit)
    consistent = consistent.named(f"{prefix}{SET_PREFIX}in_range")
    prior, scale = prior_summary(family), context.target_scale
    names = ("mean", "std", "low", "high")
    # one vector, whose parts are the outputs: onnxruntime takes two nodes for each row of a matrix
    estimated = concat([mean, std, interval.reshape(-1)], axis=0)
    chosen = where(enough, estimated, np.concatenate([prior[name] for name in names]))
    if scale is not None:
        chosen = chosen * concat([scale] * len(names), axis=0)
    for name, part in zip(names, chosen.split(len(names), axis=0), strict=True):
        part.named(f"{prefix}{SET_PREFIX}{name}")
    chosen = where(enough, covariance, np.diag(prior["std"] ** 2))
    if scale is not None:
        chosen = chosen * (scale * scale.reshape(-1, 1))
    chosen.named(f"{prefix}{SET_PREFIX}covariance")
    ends = np.asarray([axis.ends for axis in family.axes[: family.targets]])
    middle, half = ends.mean(axis=1), 0.5 * np.diff(ends, axis=1)[:, 0]
    near = absolute(mean - middle) + std * EDGE_STDS > half
    near.named(f"{prefix}{SET_PREFIX}at_edge")
    vague = std > NOT_IDENTIFIED_ABOVE * prior["std"]
    (vague | ~consistent).named(f"{prefix}{SET_PREFIX}abstains")
    misfit.node("Identity").named(f"{prefix}{SET_PREFIX}misfit")


def variance_of_few_points(weights: Value) -> Value:
    r"""Variance of a parameter over that of its few weighted points, (1,).

    .. math:: \frac{1 + r}{1 - r}, \qquad r = \sum_i w_i^2

    The variance of points around their own mean is too small by 1 - r, and the variance of that
    mean is r times the variance of the parameter. For n equal weights r is 1 / n.

    weights: Weights (1, n) with sum 1.

    References: Kish, Survey Sampling, 1965 (effective sample size 1 / r).
    """
    share = minimum(weights.sum_of_squares(axis=1, keepdims=False), LARGEST_SHARE)
    return (share + 1.0) / (1.0 - share)


def prior_summary(family: WheelFamily) -> dict[str, Floats]:
    """Mean, standard deviation and interval of the prior of each target, without their scale."""
    u = (np.arange(PRIOR_POINTS) + 0.5) / PRIOR_POINTS
    axes = family.axes[: family.targets]
    values = np.stack([axis.value(axis.quantile(u)) for axis in axes])
    low, high = np.quantile(values, INTERVAL, axis=1)
    return {"mean": values.mean(axis=1), "std": values.std(axis=1), "low": low, "high": high}


def _parameters(family: WheelFamily, order: tuple[int, ...], points: Value) -> Value:
    r"""Estimated parameters (q, n) of a sample without their scale.

    .. math:: \theta = \alpha + \delta x + e^{\log \beta + \gamma x}

    as two products with points (1, x), see `PriorAxis`.
    """
    linear, exponent = np.zeros((2, family.targets, 1 + len(order)))
    for k, axis in enumerate(family.axes[: family.targets]):
        column = 1 + order.index(k)
        linear[k, [0, column]] = axis.shift, axis.slope
        exponent[k, [0, column]] = np.log(max(axis.factor, ZERO_FACTOR)), axis.rate
    graph = points.graph
    exponential = exp(constant(graph, exponent) @ points)
    return constant(graph, linear) @ points + exponential
