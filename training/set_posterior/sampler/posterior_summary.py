"""Outputs of a set posterior as nodes of a graph: mean, covariance, interval, flags."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.estimate import EDGE_STDS
from soilml.onboard.set_contract import SET_PREFIX
from soilml.quantities import NOT_IDENTIFIED_ABOVE
from training.onnx_graph.value import Value, concat, constant, exp, gemm, sqrt, where
from training.set_posterior.families.wheel_family import ContextValues, WheelFamily
from training.set_posterior.sampler.credible_interval import INTERVAL, add_quantiles
from training.set_posterior.sampler.importance_sampler import WeightedSample
from training.set_posterior.sampler.misfit_test import Consistency

Floats = NDArray[np.float64]

#: Stands for a factor of zero, of which the logarithm is taken.
ZERO_FACTOR = 1e-30
#: Quantiles of the prior, in equal steps of probability, over which its moments are computed.
PRIOR_POINTS = 4096


def add_posterior_outputs(
    family: WheelFamily,
    context: ContextValues,
    sample: WeightedSample,
    consistency: Consistency,
    prefix: str,
) -> None:
    r"""Add the outputs, each named `<prefix>set_<name>`, from the moments of the weighted sample.

    .. math:: \mu = \sum_i w_i \theta_i, \qquad
        \Sigma = \sum_i w_i (\theta_i - \mu) (\theta_i - \mu)^T

    A set without enough rows in range gets the prior. Of a set that no soil explains, the sample
    is that with the noise that explains it, and the flag is false.
    """
    q = family.targets
    value = _parameters(family, sample)
    mean = gemm(value, sample.weights, transpose_b=True)
    deviation = value - mean
    covariance = gemm(deviation * sample.weights, deviation, transpose_b=True)
    variance = (covariance * np.eye(q)).sum(axis=1, keepdims=True)
    std = sqrt(variance)
    interval = mean + add_quantiles(deviation, std, sample.weights, sample.count)
    enough = consistency.enough.reshape(1, 1)
    consistent = enough & (sample.misfit <= consistency.limit).reshape(1, 1)
    prior = prior_summary(family)
    names = ("mean", "std", "low", "high")
    estimated = concat([mean, std, interval], axis=1)  # (q, 4)
    fallback = np.stack([prior[name] for name in names], axis=1)
    chosen, scale = where(enough, estimated, fallback), context.target_scale
    if scale is not None:
        chosen = chosen * scale
    for name, column in zip(names, chosen.split(4, axis=1), strict=True):
        column.reshape(q).named(f"{prefix}{SET_PREFIX}{name}")
    chosen = where(enough, covariance, np.diag(prior["std"] ** 2))
    if scale is not None:
        chosen = chosen * gemm(scale, scale, transpose_b=True)
    chosen.named(f"{prefix}{SET_PREFIX}covariance")
    consistent.reshape(1).named(f"{prefix}{SET_PREFIX}in_range")
    _add_edge_flag(family, mean, std).named(f"{prefix}{SET_PREFIX}at_edge")
    vague = std > NOT_IDENTIFIED_ABOVE * prior["std"][:, None]
    (vague | ~consistent).reshape(q).named(f"{prefix}{SET_PREFIX}abstains")
    sample.misfit.node("Identity").named(f"{prefix}{SET_PREFIX}misfit")


def _add_edge_flag(family: WheelFamily, mean: Value, std: Value) -> Value:
    """Whether a mean is within `EDGE_STDS` standard deviations of an end of its prior, (q,)."""
    ends = np.asarray([axis.ends for axis in family.axes[: family.targets]])
    margin = std * EDGE_STDS
    low, high = mean - margin < ends[:, :1], mean + margin > ends[:, 1:]
    return (low | high).reshape(family.targets)


def prior_summary(family: WheelFamily) -> dict[str, Floats]:
    """Mean, standard deviation and interval of the prior of each target, without their scale."""
    u = (np.arange(PRIOR_POINTS) + 0.5) / PRIOR_POINTS
    axes = family.axes[: family.targets]
    values = np.stack([axis.value(axis.quantile(u)) for axis in axes])
    low, high = np.quantile(values, INTERVAL, axis=1)
    return {"mean": values.mean(axis=1), "std": values.std(axis=1), "low": low, "high": high}


def _parameters(family: WheelFamily, sample: WeightedSample) -> Value:
    r"""Estimated parameters (q, n) of a sample without their scale.

    .. math:: \theta = \alpha + \delta x + e^{\log \beta + \gamma x}

    as two products with points (1, x), see `Coordinate`.
    """
    linear, exponent = np.zeros((2, family.targets, 1 + len(family.axes)))
    for k, axis in enumerate(family.axes[: family.targets]):
        column = 1 + sample.order.index(k)
        linear[k, [0, column]] = axis.shift, axis.slope
        exponent[k, [0, column]] = np.log(max(axis.factor, ZERO_FACTOR)), axis.rate
    graph = sample.points.graph
    exponential = exp(constant(graph, exponent) @ sample.points)
    return constant(graph, linear) @ sample.points + exponential
