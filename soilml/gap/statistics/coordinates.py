"""Coordinates of a fit: soil parameters, effect sizes and effect shapes in one vector."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.gap.data.stacked_readings import StackedReadings
from soilml.identification.free_parameters import FreeParameter
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.effects.base import Effect

Floats = NDArray[np.float64]

#: Step of the difference quotients, in units of the coordinate: a fraction of a soil parameter's
#: prior range, or of an effect's reference size.
DIFFERENCE_STEP = 1e-5
#: Prior standard deviations of an effect's two shape coefficients, in their own units.
SHAPE_STD = {"by_slip": 3.0, "by_load": 1.0}


@dataclass(frozen=True)
class FitCoordinate(ABC):
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
class SoilCoordinate(FitCoordinate):
    """A soil parameter: x is its cumulative probability under the prior, from 0 to 1."""

    @property
    def path(self) -> str:
        """Path of the parameter in the case: its name."""
        return self.name


@dataclass(frozen=True, kw_only=True)
class EffectCoordinate(FitCoordinate):
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
    for name, std in SHAPE_STD.items():
        if name in declared(effect):
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
    case: Case, coordinates: Sequence[FitCoordinate], x: Floats, readings: StackedReadings
) -> Floats:
    """Predictions (sets, m) at coordinates `x` (sets, p); NaN where there is no equilibrium."""
    values = {c.path: c.value(x[:, i])[:, None] for i, c in enumerate(coordinates)}
    changed = case.with_values(values) if values else case
    force = changed.model(changed.soil, readings.at)
    shape = (len(x), len(readings.run))
    return readings.stack(
        {name: np.broadcast_to(getattr(force, name), shape) for name in readings.channels}
    )


def linearise(
    case: Case, coordinates: Sequence[FitCoordinate], x: Floats, readings: StackedReadings
) -> tuple[Floats, Floats]:
    """Predictions (m,) at `x` (p,) and their Jacobian (m, p), from one call of the model.

    One-sided differences; the step points downwards for a coordinate at its upper bound.
    """
    p = len(coordinates)
    upper = np.asarray([coordinate.upper for coordinate in coordinates])
    step = np.where(x + DIFFERENCE_STEP <= upper, DIFFERENCE_STEP, -DIFFERENCE_STEP)
    sets = np.tile(x, (p + 1, 1))
    sets[np.arange(p), np.arange(p)] += step
    y = predict_readings(case, coordinates, sets, readings)
    return y[-1], np.asarray(((y[:-1] - y[-1]) / step[:, None]).T)
