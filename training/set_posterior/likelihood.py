"""The likelihood of a set as the sampler of its posterior takes it, as nodes of a graph."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from soilml.onboard.set_contract import MODEL_ERROR_COLUMNS, SENSOR_ERROR_COLUMNS
from training.onnx_graph.value import Value, concat
from training.set_posterior.error_scales import ErrorScales
from training.set_posterior.families.wheel_family import ContextValues, WheelFamily
from training.set_posterior.residual_system import ResidualRows
from training.set_posterior.response_surface import Response
from training.set_posterior.scale_mixture import ScaleMixture, add_scale_mixture
from training.set_posterior.sensor_errors import integrate_out_sensor_errors

#: Columns of errors in the residual system: of the sensors, and of the model.
OF_SENSORS, OF_MODEL = len(SENSOR_ERROR_COLUMNS), len(MODEL_ERROR_COLUMNS)
#: The likelihood whose errors of sensors and model are linear at a soil, given by its monomials
#: (terms, 1).
MixtureAt = Callable[[Value], ScaleMixture]


@dataclass(frozen=True)
class SetReadings:
    """SetReadings of a set: those of earlier calls, and new ones."""

    rows: ResidualRows
    state: Value  # residual system (kept, terms + errors) of earlier readings
    size: Value  # size of the errors of the model, (1,)
    scales: ErrorScales  # their sizes where that is inferred
    grown: str  # name of the output for the state with the new rows


@dataclass(frozen=True)
class Likelihood:
    """What the sampler needs of the readings of a set, in the unknowns that it samples."""

    family: WheelFamily
    response: Response
    context: ContextValues
    #: adds the residuals (m, terms) of a model without errors, those of sensors integrated out
    start: Callable[[], Value]
    mixture_at: MixtureAt


def add_likelihood(
    family: WheelFamily, response: Response, context: ContextValues, readings: SetReadings
) -> Likelihood:
    """The likelihood with all unknowns of the family and all terms of the response."""
    terms = len(response.terms)
    earlier, _ = readings.state.split([terms + OF_SENSORS, OF_MODEL], axis=1)
    start = concat([earlier, readings.rows.system_at(None)], axis=0)

    def mixture_at(basis: Value) -> ScaleMixture:
        new = readings.rows.system_at(basis)
        system = concat([readings.state, new], axis=0).named(readings.grown)
        whole, sensors, model = system.split([terms, OF_SENSORS, OF_MODEL], axis=1)
        system = concat([whole, model, sensors], axis=1)
        system = integrate_out_sensor_errors(system, terms + OF_MODEL)
        return add_scale_mixture(system, readings.size, terms, readings.scales)

    return Likelihood(
        family, response, context, lambda: integrate_out_sensor_errors(start, terms), mixture_at
    )
