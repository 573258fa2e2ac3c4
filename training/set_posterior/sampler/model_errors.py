"""Errors of the model that all readings share, as nodes of a graph."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from soilml.onboard.set_contract import MODEL_ERROR_COLUMNS, MODEL_ERROR_INPUT, RESPONSE_CHANNELS
from training.onnx_graph.value import Value, concat, exp, log, maximum
from training.set_posterior.families.coordinates import Coordinate
from training.set_posterior.families.wheel_family import SMALLEST, ContextValues, WheelFamily
from training.set_posterior.monomials import ONE, Terms, derivative
from training.set_posterior.response_surface import Response
from training.set_posterior.response_values import SoilValues

#: The unknown that is a strength, beside the bearing modulus.
COHESION = "cohesion"


@dataclass(frozen=True)
class ModelErrors:
    """Changes of the residuals with errors of the model, before weights."""

    terms: Terms
    cohesion: tuple[int, Coordinate] | None  # number of its axis, from 1, and the axis
    profile: Value  # (1, rows, 3) log bearing modulus for one standard deviation of its errors
    torque_change: Value  # (channels, rows, 1) of the torque's scale with the logarithm of torque
    contact: SoilValues | None
    contact_std: Value  # (1,)
    scales: Value  # (channels, 1, 2) errors of sinkage and drawbar pull

    def columns_at(self, load_slopes: Value, coefficients: Value, basis: Value) -> Value:
        r"""Columns (channels, rows, errors) at a soil, in the order of `MODEL_ERROR_COLUMNS`.

        Changes with the bearing modulus k follow from those with load W and cohesion c. On a soil
        that is stronger by some factor, under a load that is larger by the same factor, T / W,
        sinkage and P / W are what they were, for every law of stress in which strength is c, k or a
        multiple of them:

        .. math:: \frac{\partial f}{\partial \ln k} =
            - \frac{\partial f}{\partial \ln W} - \frac{\partial f}{\partial \ln c}

        A scale of torque without load changes with the logarithm of torque itself in addition.

        Parameters
        ----------
        load_slopes : Value
            Derivatives of the channels by log load (channels, rows, 1), at the same soil.
        coefficients : Value
            Coefficients of the channels (channels, rows, terms).
        basis : Value
            Monomials (terms, 1) of the soil.
        """
        change = self.torque_change - load_slopes
        if self.cohesion is not None:
            change = change - coefficients @ _by_log_value(basis, self.terms, *self.cohesion)
        columns = [change * self.profile]
        if self.contact is not None:
            contact = (self.contact.at(basis) * self.contact_std).node("Transpose")
            columns.append(contact.reshape(len(RESPONSE_CHANNELS), -1, 1))
        else:
            columns.append(change * 0.0)
        columns.append(change * 0.0 + self.scales)
        return concat(columns, axis=2)


def add_model_errors(
    family: WheelFamily,
    response: Response,
    context: ContextValues,
    readings: Mapping[str, Value],
    slope: Value,
) -> ModelErrors:
    """How residuals change with the errors of the model.

    Parameters
    ----------
    family, response : WheelFamily, Response
        Usual errors of the model, and surfaces of the channels and of their changes.
    context : ContextValues
        Features, and how the scale of torque depends on load.
    readings : mapping
        Readings by input name.
    slope : Value
        Derivatives of the channels' scales by the readings, (channels, rows).
    """
    stds, size = family.model_errors(), readings[MODEL_ERROR_INPUT]
    slip, load = readings["slip"], readings["load"]
    log_load = log(maximum(load, SMALLEST)) - context.usual_log_load
    bearing = [
        slip * 0.0 + stds["bearing"],
        slip * stds["bearing_by_slip"],
        log_load * stds["bearing_by_load"],
    ]
    profile = concat([part * size for part in bearing], axis=0).reshape(1, 3, -1)
    of_torque = np.zeros((len(RESPONSE_CHANNELS), 1))
    of_torque[0] = 1.0 - context.torque_by_load
    scales = np.zeros((len(RESPONSE_CHANNELS), 1, 2))
    scales[1, 0, 0], scales[2, 0, 1] = stds["sinkage"], stds["drawbar_pull"]
    names = [axis.name for axis in family.axes]
    known = COHESION in names
    axis = names.index(COHESION) if known else 0
    assert len(MODEL_ERROR_COLUMNS) == len(bearing) + 1 + scales.shape[-1]
    return ModelErrors(
        response.terms,
        (axis + 1, family.axes[axis]) if known else None,
        profile.node("Transpose", perm=[0, 2, 1]),
        (slope * readings["torque"] * of_torque).reshape(len(RESPONSE_CHANNELS), -1, 1),
        None if response.contact is None else response.contact.add_at_soil(context.features),
        size * stds["contact"],
        size.reshape(1, 1, 1) * scales,
    )


def _by_log_value(basis: Value, terms: Terms, number: int, axis: Coordinate) -> Value:
    r"""Derivatives (terms, 1) of the monomials by the logarithm of one unknown, at a soil.

    .. math:: \frac{\partial b}{\partial \ln \theta} = D b \, \frac{\theta}{d\theta / dx}
    """
    linear = terms.index((*(ONE,) * (len(terms[0]) - 1), number))
    x = basis.take([linear], axis=0)
    growth = exp(x * axis.rate) * axis.factor
    value = growth + x * axis.slope + axis.shift
    by_x = growth * axis.rate + axis.slope
    return (derivative(terms, number) @ basis) * (value / by_x)
