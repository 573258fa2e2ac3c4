"""Coordinates of a fit: soil parameters, effect sizes and effect shapes in one vector."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.free_parameters import FreeParameter
from soilml.fitting.predictions import (
    PredictionRequest,
    linearise_many,
    predict_many,
)
from soilml.fitting.readings import Readings
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.effects.base import Effect, SlipLoadScaling

Floats = NDArray[np.float64]

#: Prior standard deviations of an effect's shape coefficients, in their own units.
SHAPE_STD = {"slip_power": 1.0, "by_slip": 3.0, "by_load": 1.0}


@dataclass(frozen=True)
class Coordinate(ABC):
    """One coordinate x of a fit: its bounds, and how it maps to the value of a parameter.

    `name` is the parameter's name within its soil or effect. `prior` maps x to the value. `std`
    is the standard deviation of a Gaussian prior of x with mean zero, infinite where there is none.
    """

    name: str
    unit: str
    lower: float
    upper: float
    prior: Prior
    std: float = float("inf")

    @property
    @abstractmethod
    def path(self) -> str:
        """Path of the parameter in the case."""

    def value(self, x: Floats) -> Floats:
        """Values of the parameter at coordinates x."""
        return self.prior.at(x)

    def rate(self, x: float) -> float:
        """Derivative of the value with respect to x."""
        return float(self.prior.rate(np.asarray([x]))[0])


@dataclass(frozen=True)
class SoilCoordinate(Coordinate):
    """A soil parameter: x is its cumulative probability under the prior, from 0 to 1."""

    @property
    def path(self) -> str:
        """Path of the parameter in the case: its name."""
        return self.name


@dataclass(frozen=True, kw_only=True)
class EffectCoordinate(Coordinate):
    """The size of an effect, x being in reference sizes, or one of its shape coefficients."""

    effect: str
    is_shape: bool = False

    @property
    def path(self) -> str:
        """Path of the parameter in the case: effect.parameter."""
        return f"{self.effect}.{self.name}"


def soil_coordinate(free: FreeParameter) -> SoilCoordinate:
    """The coordinate of a free soil parameter."""
    return SoilCoordinate(free.path, free.unit, 0.0, 1.0, free.prior)


def size_coordinate(effect: type[Effect], calibration: float | None) -> EffectCoordinate:
    """The coordinate of an effect's size.

    `calibration` is the prior standard deviation of the size in its own unit; None: no prior.
    """
    size = effect.about.size
    parameter = declared(effect)[size]
    unit = effect.about.reference[size]
    lower, upper = sorted((parameter.lower / unit, parameter.upper / unit))
    return EffectCoordinate(
        size,
        parameter.unit,
        lower,
        upper,
        Prior(0.0, unit),
        float("inf") if calibration is None else calibration / abs(unit),
        effect=effect.name,
    )


def shape_coordinates(effect: type[Effect]) -> list[EffectCoordinate]:
    """The coordinates of an effect's shape coefficients; none where its law has no uncertainty."""
    coordinates = []
    for name in effect.law_terms if issubclass(effect, SlipLoadScaling) else ():
        std = SHAPE_STD[name]
        bound = min(declared(effect)[name].upper, 4.0 * std)
        coordinates.append(
            EffectCoordinate(
                name,
                "1",
                -bound,
                bound,
                Prior(0.0, 1.0),
                std,
                effect=effect.name,
                is_shape=True,
            )
        )
    return coordinates


def predict_readings(
    case: Case, coordinates: Sequence[Coordinate], x: Floats, readings: Readings
) -> Floats:
    """Predictions (sets, m) at coordinates `x` (sets, p); NaN where there is no equilibrium."""
    (prediction,) = predict_many([PredictionRequest(case, coordinates, x, readings)])
    if isinstance(prediction, InputError):
        raise prediction
    return prediction


def linearise(
    case: Case, coordinates: Sequence[Coordinate], x: Floats, readings: Readings
) -> tuple[Floats, Floats]:
    """Predictions (m,) at `x` (p,) and their Jacobian (m, p); see `linearise_many`."""
    (found,) = linearise_many([PredictionRequest(case, coordinates, x[None, :], readings)])
    if isinstance(found, InputError):
        raise found
    return found.prediction, found.jacobian
