"""Errors of slip and load, and errors that all readings share, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.onboard.set_contract import OPERATING_STD_INPUTS, RESPONSE_CHANNELS
from training.onnx_graph.value import Value, concat, constant, gemm, maximum, sqrt
from training.set_posterior.families.wheel_family import SMALLEST, ContextValues


@dataclass(frozen=True)
class SensorErrors:
    """Changes of the residuals with errors of the sensors, before weights."""

    by_reading: Value  # (2, channels, rows): what load's change of the scales adds to the slopes
    per_error: Value  # (4, 1, rows): log slip and log load for one standard deviation of each error
    offsets: Value  # (channels, rows, channels + 1): offset of each channel, and gain of torque

    def columns_at(self, slopes: Value) -> tuple[Value, Value]:
        """Columns of the common errors (channels, rows, errors), and of each row's own, at a soil.

        `slopes` (2, channels, rows) are derivatives of the channels there by log slip and log load.
        """
        slopes = slopes + self.by_reading
        both = concat([slopes, slopes], axis=0) * self.per_error
        operating = both.node("Transpose", perm=[1, 2, 0])
        common, of_row = operating.split(2, axis=2)
        return concat([self.offsets, common], axis=2), of_row


def add_sensor_errors(
    context: ContextValues,
    readings: dict[str, Value],
    slope: Value,
    y: Value,
) -> SensorErrors:
    r"""How residuals change with the errors of the sensors.

    The reading of slip is s + e. The residual of channel k, :math:`f_k(s + e) - y_k`, changes by
    :math:`f_k' e`. An error of load changes torque over load and drawbar pull over load as well:
    with the relative error e of load, the residuals of the three channels change by
    :math:`(f_1' + 1) e`, :math:`f_2' e` and :math:`(f_3' + f_3) e`, with f' the derivatives by the
    logarithm of load.

    Parameters
    ----------
    context : ContextValues
        The torque reading on its scale, and how that depends on load.
    readings : dict
        Readings and standard deviations by input name.
    slope, y : Value
        Derivatives of the channels' scales by the readings, and readings on these scales,
        (channels, rows).
    """
    graph, channels = y.graph, len(RESPONSE_CHANNELS)
    torque, pull = np.zeros((2, 2, channels, 1))
    torque[1, 0], pull[1, 2] = context.torque_by_load, 1.0
    by_reading = y * pull + torque
    slip, load = (maximum(readings[name], SMALLEST) for name in ("slip", "load"))
    none = constant(graph, 0.0)
    per_error = [
        readings["slip_bias"] / slip,
        readings["load_gain"] + load * none,
        readings["slip_std"] / slip,
        readings["load_std"] / load,
    ]
    stds = [readings["torque_bias"]]
    stds += [readings[f"{name}_bias"] + load * none for name in RESPONSE_CHANNELS[1:]]
    gain = readings["torque_gain"] * readings["torque"]
    offset = concat([*stds, gain], axis=0).reshape(channels + 1, -1).node("Transpose")
    # column k has the offset of channel k; the last has the gain of torque
    channel_of_column = np.eye(channels, channels + 1)[:, None]
    channel_of_column[0, 0, -1] = 1.0
    return SensorErrors(
        by_reading,
        concat(per_error, axis=0).reshape(2 * len(OPERATING_STD_INPUTS), 1, -1),
        slope.reshape(channels, -1, 1) * channel_of_column * offset,
    )


def whiten_rows(system: Value, columns: int, errors: int) -> Value:
    r"""Systems (channels, rows, columns) without their last columns: errors of each row alone.

    With g the changes of the residuals of one row with an error that has a normal prior with
    standard deviation 1, the covariance of these residuals is I + g g^T. They are whitened by its
    symmetric square root S:

    .. math:: I + g g^T = S S^T, \qquad A' = S^{-1} A = A - \frac{g}{\kappa} (g^T A), \qquad
        \kappa = 1 + g^T g + (1 + g^T g)^{1/2}

    Several errors are integrated out one after another: the columns of the others are whitened as
    the rest of the system is.
    """
    for last in range(columns - 1, columns - 1 - errors, -1):
        a, g = system.split([last, 1], axis=2)
        projection = (g * a).sum(axis=0, keepdims=True)
        system = a - g / _kappa(g.sum_of_squares(axis=0, keepdims=True)) * projection
    return system


def integrate_out_errors(system: Value, terms: int, errors: int) -> Value:
    """The system (m, terms) with the errors that all readings share integrated out.

    As `whiten_rows`, with all readings in place of the channels of one row.

    Parameters
    ----------
    system : Value
        Rows (w a, w g), (m, terms + errors).
    terms, errors : int
        Number of monomials, and of errors.
    """
    for last in range(terms + errors - 1, terms - 1, -1):
        a, g = system.split([last, 1], axis=1)
        projection = gemm(g, a, transpose_a=True)
        system = gemm(g / _kappa(g.sum_of_squares(keepdims=True)), projection, a, alpha=-1.0)
    return system


def _kappa(squares: Value) -> Value:
    determinant = squares + 1.0
    return determinant + sqrt(determinant)
