"""Readings of a set as rows of one linear system of monomials, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.onboard.set_contract import RESPONSE_CHANNELS
from training.onnx_graph.value import Value, absolute, concat, constant, gemm, log, maximum, sqrt
from training.set_posterior.families.wheel_family import (
    MOST_RELATIVE_NOISE,
    SMALLEST,
    ContextValues,
    WheelFamily,
)
from training.set_posterior.response_surface import Response

#: Tolerance of the box of features, as a share of its width: float32 rounds readings at its ends.
BOX_TOLERANCE = 1e-3
#: Drawbar pull over load, which has no logarithm, may have any noise; absent readings have far
#: more.
MOST_PULL_NOISE = 1e3


@dataclass(frozen=True)
class ResidualSystem:
    """Residuals of a set's readings, linear in the monomials of the unknowns.

    A row of the system is (a w, w g): the coefficients a of a channel's polynomial less the
    reading, over the standard deviation 1 / w of the noise, and the change of that residual with
    one standard deviation of the torque sensor's bias.
    """

    system: Value  # (readings, terms + 1)
    in_range: Value  # (rows,) whether the features lie in the range of the response surface
    counts: Value  # (3,) float32: readings in the system, rows, rows in range


def add_residual_system(
    family: WheelFamily, response: Response, readings: dict[str, Value]
) -> tuple[ContextValues, ResidualSystem]:
    r"""Residuals of the three channels of each row, as polynomials of the unknowns.

    .. math:: e_k(x) = \frac{\sum_j a_{kj} b_j(x) - y_k}{\sqrt{\sigma_k^2 + \epsilon_k^2}}

    with y the torque on the scale of the response, the logarithm of sinkage over length, or drawbar
    pull over load, sigma its noise on that scale, and epsilon the error of the response surface.
    Readings out of range, or with too much noise for a logarithm, are left out.
    """
    context = family.add_context(readings)
    in_range = _in_range(response, context.features)
    one = constant(context.features.graph, 1.0)
    sinkage = maximum(readings["sinkage"], SMALLEST)
    per_load = one / readings["load"]
    # derivatives of the three scales by torque, sinkage and drawbar pull
    slope = _channel_rows([context.torque_slope, one / sinkage, per_load])
    noise = _channel_rows([readings[f"{name}_std"] for name in RESPONSE_CHANNELS]) * slope
    log_sinkage = log(sinkage / context.length)
    y = _channel_rows([context.torque, log_sinkage, readings["drawbar_pull"] * per_load])
    most_noise = np.asarray([[context.most_torque_noise], [MOST_RELATIVE_NOISE], [MOST_PULL_NOISE]])
    used = (noise < most_noise) & in_range
    used_float = used.astype(np.float32)
    weight = used_float / sqrt(noise * noise + response.error[:, None] ** 2)
    torque_only = np.asarray([[1.0], [0.0], [0.0]])
    bias = readings["torque_bias"] * context.torque_slope * torque_only
    # -y is added to the constant term, the first; the bias fills the last column, which is 0
    y_and_bias = concat([y, bias], axis=0).reshape(2, -1)
    columns = np.zeros((2, len(response.terms) + 1))
    columns[0, 0], columns[1, -1] = -1.0, 1.0
    coefficients = response.add_coefficients(context.features)
    residuals = gemm(y_and_bias, columns, coefficients, transpose_a=True)
    weighted = residuals * weight.reshape(-1, 1)
    system = weighted.node("Compress", used.reshape(-1), axis=0)
    counts = [
        used_float.sum().reshape(1),
        in_range.node("Shape").astype(np.float32),
        in_range.astype(np.float32).sum(),
    ]
    return context, ResidualSystem(system, in_range, concat(counts, axis=0))


def _in_range(response: Response, features: Value) -> Value:
    """Whether features (rows, f) lie in the box of the designs of the response surface, (rows,)."""
    tolerance = BOX_TOLERANCE * (response.upper - response.lower)
    middle = 0.5 * (response.upper + response.lower)
    half_width = 0.5 * (response.upper - response.lower)
    outside = absolute(features - middle) > half_width + tolerance
    any_outside = outside.astype(np.int32).reduce("ReduceMax", axis=1, keepdims=False)
    return ~any_outside.astype(np.bool_)


def integrate_out_bias(system: Value, terms: int) -> Value:
    r"""The system (m, terms) with the bias of the torque sensor integrated out.

    The bias has a normal prior with standard deviation 1 in units of g, so that the covariance of
    the residuals is I + g g^T. The system is whitened by its symmetric square root S:

    .. math:: I + g g^T = S S^T, \qquad A' = S^{-1} A = A - \frac{g}{\kappa} (g^T A), \qquad
        \kappa = 1 + g^T g + (1 + g^T g)^{1/2}

    Parameters
    ----------
    system : Value
        Rows (a w, w g), (m, terms + 1).
    terms : int
        Number of monomials.
    """
    one = constant(system.graph, 1.0)
    a, g = system.split([terms, 1], axis=1)
    determinant = g.sum_of_squares(keepdims=True) + one
    kappa = determinant + sqrt(determinant)
    projection = gemm(g, a, transpose_a=True)
    return gemm(g / kappa, projection, a, alpha=-1.0)


def _channel_rows(values: list[Value]) -> Value:
    """Values (rows,) of each channel as the rows of a matrix (channels, rows)."""
    return concat(values, axis=0).reshape(len(values), -1)
