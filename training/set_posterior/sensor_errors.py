"""Errors of slip and load, and errors that all readings share, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.onboard.set_contract import (
    OPERATING_STD_INPUTS,
    RESPONSE_CHANNELS,
)
from training.onnx_graph.value import Value, concat, sqrt
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
    """Errors of sensors, and the changes of the residuals with them before weights."""

    context: ContextValues  # how the scale of torque depends on load
    readings: dict[str, Value]  # readings and standard deviations by input name
    operating: OperatingReadings
    y: Value  # readings on the scales of the channels, (channels, rows)
    slope: Value  # derivatives of these scales by the readings, (channels, rows)

    def of_residuals(self, slopes: Value) -> Value:
        r"""Derivatives (2, channels, rows) of residuals by log slip and log load.

        The reading of slip is s + e. The residual of channel k, :math:`f_k(s + e) - y_k`, changes
        by :math:`f_k' e`. An error of load changes torque over load and drawbar pull over load as
        well: with the relative error e of load, the residuals of the three channels change by
        :math:`(f_1' + 1) e`, :math:`f_2' e` and :math:`(f_3' + f_3) e`, with f' the derivatives by
        the logarithm of load.

        slopes: Derivatives (2, channels, rows) of the channels at a soil.
        """
        torque, pull = np.zeros((2, 2, CHANNELS, 1))
        torque[1, 0], pull[1, 2] = self.context.torque_by_load, 1.0
        return slopes + (self.y * pull + torque)

    def common_columns(self, slopes: Value) -> Value:
        """Columns (errors, readings) of the common errors, in their order.

        slopes: Those of the residuals.
        """
        slip, load = self.operating.values.split(2, axis=0)
        shared = [self.readings["slip_bias"] / slip, self.readings["load_gain"] + load * 0.0]
        of_operating = slopes * concat(shared, axis=0).reshape(2, 1, -1)
        return concat([self._offsets(), of_operating.reshape(2, -1)], axis=0)

    def _offsets(self) -> Value:
        """Columns (channels + 1, readings) of the channels' offsets, and of the gain of torque."""
        readings = self.readings
        none = readings["load"] * 0.0
        stds = [readings["torque_bias"]]
        stds += [readings[f"{name}_bias"] + none for name in RESPONSE_CHANNELS[1:]]
        offsets = concat([*stds, readings["torque_gain"] * readings["torque"]], axis=0)
        # row k has the offset of channel k; the last has the gain of torque
        channel_of_row = np.eye(CHANNELS + 1, CHANNELS)[..., None]
        channel_of_row[-1, 0] = 1.0
        scale = self.slope * channel_of_row
        return (scale * offsets.reshape(CHANNELS + 1, 1, -1)).reshape(CHANNELS + 1, -1)

    def whitened(self, system: Value, slopes: Value, weight: Value) -> Value:
        """A system (columns, readings) with errors of each row integrated out.

        slopes: Those of the residuals.
        weight: That of each reading (1, readings).
        """
        noise = self.operating.relative_noise.reshape(len(OPERATING_STD_INPUTS), 1, -1)
        return whiten_rows(system, (slopes * noise).reshape(2, -1) * weight)


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


def _kappa(determinant: Value) -> Value:
    return determinant + sqrt(determinant)
