"""Errors of the model that all readings share, as nodes of a graph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from soilml.onboard.set_contract import (
    LAW_ERROR_COLUMNS,
    MODEL_ERROR_COLUMNS,
    MODEL_ERROR_INPUT,
    RESPONSE_CHANNELS,
)
from training.onnx_graph.value import Value, concat, exp, gemm, log, maximum
from training.set_posterior.error_scales import OF_CHANNELS
from training.set_posterior.families.coordinates import PriorAxis
from training.set_posterior.families.wheel_family import SMALLEST, ContextValues, WheelFamily
from training.set_posterior.monomials import ONE, Terms, derivative
from training.set_posterior.response_surface import Response

FRICTION = "friction_angle"
STRENGTH, MODULUS = ("cohesion", FRICTION), ("shear_modulus",)  # Unknowns of the shear strength
GROWS = "_by_slip"  # End of the names of errors that grow with slip


@dataclass(frozen=True)
class ModelErrors:
    """Changes of the residuals with errors of the model, before weights."""

    #: typical errors of the model, and surfaces of the channels and of their changes
    family: WheelFamily
    response: Response
    context: ContextValues  # features, and how the scale of torque depends on load
    readings: Mapping[str, Value]  # readings by input name
    slope: Value  # derivatives of the channels' scales by the readings, (channels, rows)

    def columns_at(self, slopes: Value, coefficients: Value, basis: Value) -> Value:
        r"""Columns (errors, readings) at a soil, in the order of `MODEL_ERROR_COLUMNS`.

        Changes with the bearing modulus k follow from those with load W and cohesion c. On a soil
        that is stronger by some factor, under a load that is larger by the same factor, T / W,
        sinkage and P / W are what they were, for every law of stress in which strength is c, k or a
        multiple of them:

        .. math:: \frac{\partial f}{\partial \ln k} =
            - \frac{\partial f}{\partial \ln W} - \frac{\partial f}{\partial \ln c}

        A scale of torque without load changes with the logarithm of torque itself in addition.
        The strength is cohesion and the tangent of the friction angle. They are of usual size,
        and zero where the model is right.

        slopes: Derivatives of the channels by log slip and log load, at the same soil, (2,
            channels, rows).
        coefficients: Coefficients of the channels (terms, readings).
        basis: Monomials (terms, 1) of the soil.
        """
        stds, channels = self.family.model_errors(), len(RESPONSE_CHANNELS)
        slip, load, torque = (self.readings[name] for name in ("slip", "load", "torque"))
        slope = self.slope
        log_load = log(maximum(load, SMALLEST)) - self.context.reference_log_load
        bearing = [
            slip * 0.0 + stds["bearing"],
            slip * stds["bearing_by_slip"],
            log_load * stds["bearing_by_load"],
        ]
        profile = concat(bearing, axis=0).reshape(3, 1, -1)
        first = np.zeros((channels, 1))
        first[0] = 1.0
        of_torque = first * (1.0 - self.context.torque_by_load)
        change = slope * torque * of_torque - slopes.take([1], axis=0)  # (1, channels, rows)
        of_strength = self._by_logarithms(STRENGTH, coefficients, basis)
        of_modulus = self._by_logarithms(MODULUS, coefficients, basis)
        change = change - self._by_logarithms(STRENGTH[:1], coefficients, basis)
        contact = change * 0.0
        if self.response.contact is not None:
            at_soil = self.response.contact.add_at_soil(self.context.features, basis)
            contact = at_soil.reshape(1, channels, -1) * stds["contact"]
        own = (slope * torque * first + (1.0 - first)) * self._own_errors(slip)
        laws = [
            of_strength * stds["strength"],
            of_strength * (log_load * stds["strength_by_load"]).reshape(1, 1, -1),
            of_modulus * stds["shear_modulus"],
        ]
        columns = concat([change * profile, contact, own, *laws], axis=0)
        size = self.readings[MODEL_ERROR_INPUT]
        some = (size * size > 0.0).astype(np.float32)
        return columns.reshape(len(MODEL_ERROR_COLUMNS), -1) * some

    def _by_logarithms(self, names: Sequence[str], coefficients: Value, basis: Value) -> Value:
        """Sum (1, channels, rows) of the changes with the logarithms of these unknowns.

        Nil where the family has none of them.
        """
        axes = [axis.name for axis in self.family.axes]
        by_log = basis * 0.0
        for number in (axes.index(name) for name in names if name in axes):
            axis = self.family.axes[number]
            by_log = by_log + _by_log_value(basis, self.response.terms, number + 1, axis)
        change = gemm(by_log, coefficients, transpose_a=True)
        return change.reshape(1, len(RESPONSE_CHANNELS), -1)

    def _own_errors(self, slip: Value) -> Value:
        """Relative errors (errors, channels, rows) of single channels; of pull, over load."""
        stds = self.family.model_errors()
        names = MODEL_ERROR_COLUMNS[OF_CHANNELS : -len(LAW_ERROR_COLUMNS)]
        constant, growing = np.zeros((2, len(names), len(RESPONSE_CHANNELS), 1))
        for number, name in enumerate(names):
            part = growing if name.endswith(GROWS) else constant
            part[number, RESPONSE_CHANNELS.index(name.removesuffix(GROWS))] = stds[name]
        return slip * growing + constant


def _by_log_value(basis: Value, terms: Terms, number: int, axis: PriorAxis) -> Value:
    r"""Derivatives (terms, 1) of the monomials by the logarithm of one unknown, at a soil.

    .. math:: \frac{\partial b}{\partial \ln \theta} = D b \, \frac{\theta}{d\theta / dx}

    Of a friction angle it is the logarithm of its tangent, with sin(theta) cos(theta) for theta.
    """
    linear = terms.index((*(ONE,) * (len(terms[0]) - 1), number))
    x = basis.take([linear], axis=0)
    growth = exp(x * axis.rate) * axis.factor
    value = growth + x * axis.slope + axis.shift
    by_x = growth * axis.rate + axis.slope
    if axis.name == FRICTION:
        value = value.node("Sin") * value.node("Cos")
    return basis.derived(derivative(terms, number)) * (value / by_x)
