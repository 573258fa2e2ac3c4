"""Readings of a set as rows of one linear system of monomials, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.onboard.set_contract import OPERATING_NOISE, OPERATING_STD_INPUTS, RESPONSE_CHANNELS
from training.onnx_graph.value import (
    Value,
    absolute,
    concat,
    constant,
    gemm,
    log,
    maximum,
    sqrt,
)
from training.set_posterior.families.wheel_family import (
    MOST_RELATIVE_NOISE,
    SMALLEST,
    ContextValues,
    WheelFamily,
)
from training.set_posterior.model_errors import ModelErrors
from training.set_posterior.response_surface import Response, ResponseValues
from training.set_posterior.sensor_errors import OperatingReadings, SensorErrors

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

    Until the system is complete its columns are kept as rows (columns, readings), where a reading
    is one channel of one row: so they are joined without a copy of each.
    """

    weight: Value  # (1, readings), 0 for readings that are left out
    used: Value  # (readings,) whether a reading takes part
    values: ResponseValues  # the response surface at the rows, unweighted
    sensor_errors: SensorErrors
    model_errors: ModelErrors
    in_range: Value  # (rows,) whether the features lie in the range of the response surface
    counts: Value  # (3,) float32: readings in the system, rows, rows in range within their noise

    def columns_at(self, basis: Value | None) -> Value:
        r"""Columns (terms + errors, readings), with errors linear at one soil.

        Errors of a row's slip and load are part of all its channels. With d the changes of its
        weighted residuals with one standard deviation of such an error, their covariance is
        :math:`I + \sum d d^T`, by which the row is whitened.

        basis: Monomials (terms, 1) of the soil at which the residuals' derivatives by slip and load
            and the other errors are taken; None is the middle of the prior's range, and the system
            is then without columns of errors of the model.
        """
        slopes = self.values.slopes_at(basis)
        of_residuals, coefficients = (
            self.sensor_errors.of_residuals(slopes),
            self.values.coefficients,
        )
        parts = [coefficients, self.sensor_errors.common_columns(of_residuals)]
        if basis is not None:
            parts.append(self.model_errors.columns_at(slopes, coefficients, basis))
        system = concat(parts, axis=0) * self.weight
        return self.sensor_errors.whitened(system, of_residuals, self.weight)


def add_residual_rows(
    family: WheelFamily, response: Response, readings: dict[str, Value]
) -> tuple[ContextValues, ResidualRows]:
    r"""Residuals of the three channels of each row, as polynomials of the unknowns.

    .. math:: e_k(x) = \frac{\sum_j a_{kj} b_j(x) - y_k}{\sqrt{\sigma_k^2 + \epsilon_k^2}}

    with y the torque on the scale of the response, the logarithm of sinkage over length, or drawbar
    pull over load, sigma its noise on that scale, and epsilon the error of the response surface.
    Readings out of range, or with too much noise for a logarithm, are left out.

    readings: Readings and standard deviations (1, rows), and inputs of the whole set (1,), by name.
    """
    context = family.add_context(readings)
    operating, outside = _operating(readings), _outside(response, context.features)
    within = _all_below(response, outside)  # (rows,) float32
    in_range = within.astype(np.bool_)
    one = constant(outside.graph, 1.0)
    sinkage = maximum(readings["sinkage"], SMALLEST)
    per_load = one / readings["load"]
    # derivatives of the three scales by torque, sinkage and drawbar pull
    slope = concat([context.torque_slope, one / sinkage, per_load], axis=0)
    noise = concat([readings[f"{name}_std"] for name in RESPONSE_CHANNELS], axis=0) * slope
    log_sinkage = log(sinkage / context.length)
    y = concat([context.torque, log_sinkage, readings["drawbar_pull"] * per_load], axis=0)
    most_noise = np.asarray([[context.most_torque_noise], [MOST_RELATIVE_NOISE], [MOST_PULL_NOISE]])
    used = (noise < most_noise).astype(np.float32) * within  # (channels, rows)
    weight = used / sqrt(noise * noise + response.error[:, None] ** 2)
    used = used.reshape(-1)
    values = response.add_to(context.features, y, context.feature_slopes)
    # rows may be out of range by their noise: a slip at the end of the range is so half the time
    margin = -NOISE_MARGIN * np.abs(context.feature_slopes.T)
    outside_noise = gemm(constant(outside.graph, margin), operating.relative_noise, outside)
    counts = [
        used.sum(),
        in_range.node("Shape").astype(np.float32),
        _all_below(response, outside_noise).sum(),
    ]
    return context, ResidualRows(
        weight=weight.reshape(1, -1),
        used=used.astype(np.bool_),
        values=values,
        sensor_errors=SensorErrors(context, readings, operating, y, slope),
        model_errors=ModelErrors(family, response, context, readings, slope),
        in_range=in_range,
        counts=concat(counts, axis=0),
    )


def _operating(readings: dict[str, Value]) -> OperatingReadings:
    """Slip and load, and their noise."""
    values = maximum(concat([readings[name] for name in OPERATING_NOISE], axis=0), SMALLEST)
    stds = concat([readings[name] for name in OPERATING_STD_INPUTS], axis=0)
    return OperatingReadings(values, stds, stds / values)


def _outside(response: Response, features: Value) -> Value:
    """Distances (f, rows) of features from the middle of the designs of the response surface."""
    middle = 0.5 * (response.upper + response.lower)[:, None]
    return absolute(features - constant(features.graph, middle, name="range_middle"))


def _all_below(response: Response, distance: Value) -> Value:
    """1 where all distances (f, rows) are within the box of the designs, else 0, (rows,).

    Distances that are not numbers, of a wheel without size, are not.
    """
    half_width = (0.5 + BOX_TOLERANCE) * (response.upper - response.lower)[:, None]
    inside = (distance <= constant(distance.graph, half_width, name="range_half")).astype(
        np.float32
    )
    return inside.reduce("ReduceMin", axis=0, keepdims=False)
