"""Readings of a set as rows of one linear system of monomials, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.onboard.set_contract import (
    ERROR_COLUMNS,
    OPERATING_NOISE,
    OPERATING_STD_INPUTS,
    RESPONSE_CHANNELS,
    SENSOR_ERROR_COLUMNS,
)
from training.onnx_graph.value import Value, absolute, concat, constant, gemm, log, maximum, sqrt
from training.set_posterior.families.wheel_family import (
    MOST_RELATIVE_NOISE,
    SMALLEST,
    ContextValues,
    WheelFamily,
)
from training.set_posterior.response_surface import Response
from training.set_posterior.response_values import ResponseValues
from training.set_posterior.sampler.model_errors import ModelErrors, add_model_errors
from training.set_posterior.sampler.sensor_errors import (
    SensorErrors,
    add_sensor_errors,
    whiten_rows,
)

#: Tolerance of the box of features, as a share of its width: float32 rounds readings at its ends.
BOX_TOLERANCE = 1e-3
#: Rows that are out of range by up to so many standard deviations of slip or load are left out, but
#: do not count against the set.
NOISE_MARGIN = 3.0
#: Drawbar pull over load, which has no logarithm, may have any noise; absent readings have far
#: more.
MOST_PULL_NOISE = 1e3


@dataclass(frozen=True)
class ResidualRows:
    """Residuals of a set's readings, linear in the monomials of the unknowns.

    A row of the system is (w a, w g): the coefficients a of a channel's polynomial less the
    reading, over the standard deviation 1 / w of the noise, and the changes g of that residual with
    one standard deviation of each error that all rows share, in the order of `ERROR_COLUMNS`.
    """

    terms: int
    residuals: Value  # (channels, rows, terms) without weights
    weight: Value  # (channels, rows, 1), 0 for readings that are left out
    used: Value  # (channels * rows,) whether a reading takes part
    values: ResponseValues  # the response surface at the rows, with slopes by log slip and load
    sensor_errors: SensorErrors
    model_errors: ModelErrors
    in_range: Value  # (rows,) whether the features lie in the range of the response surface
    counts: Value  # (3,) float32: readings in the system, rows, rows in range within their noise

    def system_at(self, basis: Value | None) -> Value:
        r"""The system (readings, terms + errors), with errors linear at one soil.

        Errors of a row's slip and load are part of all its channels. With d the changes of its
        weighted residuals with one standard deviation of such an error, their covariance is
        :math:`I + \sum d d^T`, by which the row is whitened.

        Parameters
        ----------
        basis : Value or None
            Monomials (terms, 1) of the soil at which the residuals' derivatives by slip and load
            and the other errors are taken; None is the middle of the prior's range, and the system
            is then without columns of errors of the model.
        """
        slopes = self.values.slopes_at(basis)
        common, of_row = self.sensor_errors.columns_at(slopes)
        parts, columns = [self.residuals, common], self.terms + len(SENSOR_ERROR_COLUMNS)
        if basis is not None:
            load_slopes = slopes.take([1], axis=0).reshape(len(RESPONSE_CHANNELS), -1, 1)
            coefficients = self.values.coefficients
            parts.append(self.model_errors.columns_at(load_slopes, coefficients, basis))
            columns = self.terms + len(ERROR_COLUMNS)
        system = concat([*parts, of_row], axis=2) * self.weight
        of_each = len(OPERATING_STD_INPUTS)
        whitened = whiten_rows(system, columns + of_each, of_each)
        return whitened.reshape(-1, columns).node("Compress", self.used, axis=0)


def add_residual_rows(
    family: WheelFamily, response: Response, readings: dict[str, Value]
) -> tuple[ContextValues, ResidualRows]:
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
    values = response.add_to(context.features, context.feature_slopes)
    # -y is added to the constant term, the first
    first = np.zeros(len(response.terms))
    first[0] = 1.0
    channels = len(RESPONSE_CHANNELS)
    residuals = values.coefficients - y.reshape(channels, -1, 1) * first
    counts = [
        used_float.sum().reshape(1),
        in_range.node("Shape").astype(np.float32),
        _within_noise(response, context, readings).astype(np.float32).sum(),
    ]
    return context, ResidualRows(
        len(response.terms),
        residuals,
        weight.reshape(channels, -1, 1),
        used.reshape(-1),
        values,
        add_sensor_errors(context, readings, slope, y),
        add_model_errors(family, response, context, readings, slope),
        in_range,
        concat(counts, axis=0),
    )


def _in_range(response: Response, features: Value, margin: Value | float = 0.0) -> Value:
    """Whether features (rows, f) lie in the box of the designs of the response surface, (rows,).

    Features that are not numbers, of a wheel without size, do not. The box is enlarged by a margin
    (rows, f) on each side.
    """
    tolerance = BOX_TOLERANCE * (response.upper - response.lower)
    middle = 0.5 * (response.upper + response.lower)
    half_width = 0.5 * (response.upper - response.lower)
    inside = absolute(features - middle) - margin <= half_width + tolerance
    all_inside = inside.astype(np.int32).reduce("ReduceMin", axis=1, keepdims=False)
    return all_inside.astype(np.bool_)


def _within_noise(response: Response, context: ContextValues, readings: dict[str, Value]) -> Value:
    """Whether rows are in range, or out of it by no more than the noise of slip and load, (rows,).

    Readings of a slip at the end of the range are out of it in half of all cases.
    """
    noise = concat(
        [
            readings[std] / maximum(readings[name], SMALLEST)
            for std, name in zip(OPERATING_STD_INPUTS, OPERATING_NOISE, strict=True)
        ],
        axis=0,
    ).reshape(len(OPERATING_STD_INPUTS), -1)
    margin = gemm(noise, NOISE_MARGIN * np.abs(context.feature_slopes), transpose_a=True)
    return _in_range(response, context.features, margin)


def _channel_rows(values: list[Value]) -> Value:
    """Values (rows,) of each channel as the rows of a matrix (channels, rows)."""
    return concat(values, axis=0).reshape(len(values), -1)
