"""The likelihood of a set as the sampler of its posterior takes it, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.onboard.set_contract import (
    COMMON_ERROR_INPUTS,
    MODEL_ERROR_COLUMNS,
    SENSOR_ERROR_COLUMNS,
)
from training.onnx_graph.value import Value, concat
from training.set_posterior.error_scales import ErrorScales
from training.set_posterior.families.wheel_family import ContextValues, WheelFamily
from training.set_posterior.residual_system import ResidualRows
from training.set_posterior.response_surface import Response
from training.set_posterior.scale_mixture import ScaleMixture, add_scale_mixture
from training.set_posterior.sensor_errors import integrate_out_sensor_errors

#: Columns of errors in the residual system: of the sensors, and of the model.
OF_SENSORS, OF_MODEL = len(SENSOR_ERROR_COLUMNS), len(MODEL_ERROR_COLUMNS)


@dataclass(frozen=True)
class SetReadings:
    """Readings of a set: those of earlier calls, and new ones."""

    rows: ResidualRows
    state: Value  # residual system (kept, terms + errors) of earlier readings
    size: Value  # size of the errors of the model, (1,)
    scales: ErrorScales  # their sizes where that is inferred
    present: tuple[bool, ...]  # which of `MODEL_ERROR_COLUMNS` the model can have

    def mixture_of(self, system: Value, terms: int) -> ScaleMixture:
        """The likelihood of a system (m, terms + errors) with the model's errors integrated out."""
        return add_scale_mixture(system, self.size, terms, self.scales, self.present)


@dataclass(frozen=True)
class Likelihood:
    """What the sampler needs of the readings of a set, in the unknowns that it samples."""

    family: WheelFamily
    response: Response
    context: ContextValues
    readings: SetReadings
    #: columns of earlier readings: of monomials, errors of sensors and of the model
    earlier: tuple[Value, ...]

    @staticmethod
    def of(
        family: WheelFamily, response: Response, context: ContextValues, readings: SetReadings
    ) -> Likelihood:
        """With all unknowns of a family of wheels, and all terms of its response."""
        parts = [len(response.terms), OF_SENSORS, OF_MODEL]
        earlier = readings.state.split(parts, axis=1)
        return Likelihood(family, response, context, readings, tuple(earlier))

    @property
    def noise_alone(self) -> Value:
        """Whether the readings, those of earlier calls as well, have noise alone, (1, 1).

        Errors of the model, of slip and load, and those that readings share change with the soil.
        """
        errors = self.readings.rows.sensor_errors
        shared = concat([errors.readings[name] for name in COMMON_ERROR_INPUTS], axis=0)
        others = (errors.operating.stds, self.earlier[1], shared)
        squares = [value.sum_of_squares(keepdims=True) for value in others]
        of_torque = errors.readings["torque_bias"].sum_of_squares(keepdims=True)
        return of_torque.node("Sum", *squares) <= 0.0

    def rows_of_noise_alone(self) -> Value:
        """Rows (m, terms) of new readings that have noise alone."""
        return self.readings.rows.of_noise_alone()

    def with_noise_alone(self, rows: Value) -> Value:
        """Residuals (m, terms) of readings that have noise alone, with these new rows."""
        return concat([self.earlier[0], rows], axis=0)

    def grown(self, rows: Value) -> Value:
        """The state with these rows, which have no errors."""
        errors = rows.take([0], axis=1) * np.zeros((1, OF_SENSORS + OF_MODEL))
        return concat([self.readings.state, concat([rows, errors], axis=1)], axis=0)

    def start(self) -> Value:
        """Residuals (m, terms) of a model without errors, those of sensors integrated out.

        Errors of new readings are linear in the middle of the prior's range.
        """
        terms = len(self.response.terms)
        earlier, _ = self.readings.state.split([terms + OF_SENSORS, OF_MODEL], axis=1)
        whole = concat([earlier, self.readings.rows.system_at(None)], axis=0)
        return integrate_out_sensor_errors(whole, terms)

    def mixture_at(self, basis: Value) -> tuple[ScaleMixture, Value]:
        """The likelihood with errors linear at a soil, and the state with the new rows.

        basis: Monomials (terms, 1) of the soil.
        """
        terms = len(self.response.terms)
        new = self.readings.rows.system_at(basis)
        grown = concat([self.readings.state, new], axis=0)
        whole, sensors, model = grown.split([terms, OF_SENSORS, OF_MODEL], axis=1)
        system = concat([whole, model, sensors], axis=1)
        system = integrate_out_sensor_errors(system, terms + OF_MODEL)
        return self.readings.mixture_of(system, terms), grown
