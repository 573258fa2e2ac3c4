"""Errors of slip and load, and errors that all readings share, as nodes of a graph."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from soilml.onboard.set_contract import (
    OPERATING_STD_INPUTS,
    RESPONSE_CHANNELS,
    SENSOR_ERROR_COLUMNS,
)
from training.onnx_graph.value import Value, concat, constant, gemm, shortcut, sqrt, stack_rows
from training.set_posterior.families.wheel_family import ContextValues

CHANNELS = len(RESPONSE_CHANNELS)


@dataclass(frozen=True)
class OperatingReadings:
    """Slip and load of rows, (2, rows) each."""

    values: Value  # at least as large as the smallest number whose logarithm is taken
    stds: Value
    relative_noise: Value


@dataclass(frozen=True)
class SensorErrors:
    """Changes of the residuals with errors of slip and load, before weights."""

    by_reading: Value  # (2, channels, rows): what load's change of the scales adds to the slopes
    common: Value  # (2, 1, rows): log slip and log load for one standard deviation of the offsets
    of_row: Value  # (2, 1, rows): the same of the errors of each row
    exact: Value  # (1, 1) whether no row has errors of its own

    def columns_at(self, slopes: Value) -> tuple[Value, Value]:
        """Columns of the common errors, and of each row's own, at a soil, (2, readings) each.

        `slopes` (2, channels, rows) are derivatives of the channels there by log slip and log load.
        """
        slopes = slopes + self.by_reading
        common, of_row = slopes * self.common, slopes * self.of_row
        return common.reshape(2, -1), of_row.reshape(2, -1)

    def whitened(self, system: Value, of_row: Value) -> Value:
        """A system (columns, readings) with errors of each row (errors, readings) integrated out.

        Where slip and load of all rows are exact, nothing is to be done.
        """
        return shortcut(self.exact, lambda whole, _: whole, whiten_rows, system, of_row)


def add_sensor_errors(
    context: ContextValues, readings: dict[str, Value], operating: OperatingReadings, y: Value
) -> SensorErrors:
    r"""How residuals change with errors of slip and load.

    The reading of slip is s + e. The residual of channel k, :math:`f_k(s + e) - y_k`, changes by
    :math:`f_k' e`. An error of load changes torque over load and drawbar pull over load as well:
    with the relative error e of load, the residuals of the three channels change by
    :math:`(f_1' + 1) e`, :math:`f_2' e` and :math:`(f_3' + f_3) e`, with f' the derivatives by the
    logarithm of load.

    context: How the torque scale depends on load.
    readings: Standard deviations by input name.
    operating: Slip and load of the rows.
    y: Readings on the scales of the channels, (channels, rows).
    """
    torque, pull = np.zeros((2, 2, CHANNELS, 1))
    torque[1, 0], pull[1, 2] = context.torque_by_load, 1.0
    slip, load = operating.values.split(2, axis=0)
    common = stack_rows([readings["slip_bias"] / slip, readings["load_gain"] + load * 0.0])
    return SensorErrors(
        y * pull + torque,
        common.reshape(2, 1, -1),
        operating.relative_noise.reshape(len(OPERATING_STD_INPUTS), 1, -1),
        operating.stds.reduce("ReduceMax") <= 0.0,
    )


def add_offsets(readings: dict[str, Value], slope: Value) -> Value:
    """Columns (channels + 1, readings) of the offset of each channel, and of the gain of torque.

    `slope` (channels, rows) are derivatives of the channels' scales by the readings.
    """
    none = readings["load"] * 0.0
    stds = [readings["torque_bias"]]
    stds += [readings[f"{name}_bias"] + none for name in RESPONSE_CHANNELS[1:]]
    offsets = concat([*stds, readings["torque_gain"] * readings["torque"]], axis=0)
    # row k has the offset of channel k; the last has the gain of torque
    channel_of_row = np.eye(CHANNELS + 1, CHANNELS)[..., None]
    channel_of_row[-1, 0] = 1.0
    scale = slope * channel_of_row
    return (scale * offsets.reshape(CHANNELS + 1, 1, -1)).reshape(CHANNELS + 1, -1)


def whiten_rows(system: Value, of_row: Value) -> Value:
    r"""A system (columns, readings) with errors of each row (errors, readings) integrated out.

    With g the changes of the residuals of one row with an error that has a normal prior with
    standard deviation 1, the covariance of these residuals is I + g g^T. They are whitened by its
    symmetric square root S:

    .. math:: I + g g^T = S S^T, \qquad A' = S^{-1} A = A - \frac{g}{\kappa} (g^T A), \qquad
        \kappa = 1 + g^T g + (1 + g^T g)^{1/2}

    Several errors are integrated out one after another: the columns of the others are whitened as
    the rest of the system is.
    """
    system, *errors = (part.reshape(0, CHANNELS, -1) for part in (system, *of_row.split(2, axis=0)))
    while errors:
        g = errors.pop()
        scaled = g / _kappa(g.sum_of_squares(axis=1, keepdims=True) + 1.0)
        system, *errors = (
            part - scaled * (g * part).sum(axis=1, keepdims=True) for part in (system, *errors)
        )
    return system.reshape(0, -1)


def integrate_out_errors(system: Value, terms: int, errors: int) -> Value:
    """The system (m, terms) with the errors that all readings share integrated out.

    As `whiten_rows`, with all readings in place of the channels of one row.

    system: Rows (w a, w g), (m, terms + errors).
    terms, errors: Number of monomials, and of errors.
    """
    one = constant(system.graph, np.ones((1, 1)))
    for last in range(terms + errors - 1, terms - 1, -1):
        a, g = system.split([last, 1], axis=1)
        scaled = g / _kappa(gemm(g, g, one, transpose_a=True))
        system = gemm(scaled, gemm(g, a, transpose_a=True), a, alpha=-1.0)
    return system


def integrate_out_sensor_errors(system: Value, terms: int) -> Value:
    """The system (m, terms) with the errors in `SENSOR_ERROR_COLUMNS` integrated out.

    Many sets have no offset of torque, and sets of torque alone none of sinkage and drawbar pull.
    """
    offsets = [SENSOR_ERROR_COLUMNS.index(f"{name}_bias") for name in RESPONSE_CHANNELS]
    count, others = len(offsets), len(SENSOR_ERROR_COLUMNS) - len(offsets)

    def of_offsets(whole: Value) -> Value:
        of_torque = integrate_out_if_any(whole, terms + 1, count - 1)
        return integrate_out_errors(of_torque, terms, 1)

    return integrate_out_if_any(
        integrate_out_errors(system, terms + count, others), terms, count, of_offsets
    )


def integrate_out_if_any(
    system: Value, terms: int, errors: int, general: Callable[[Value], Value] | None = None
) -> Value:
    """As `integrate_out_errors`, but nothing is to be done where all errors are zero.

    `general` integrates them out where they are not, if it is another function.
    """
    a, g = system.split([terms, errors], axis=1)
    general = general or (lambda whole: integrate_out_errors(whole, terms, errors))
    return shortcut(
        g.sum_of_squares() <= 0.0,
        lambda _, without: without,
        lambda whole, _: general(whole),
        system,
        a,
    )


def _kappa(determinant: Value) -> Value:
    return determinant + sqrt(determinant)
