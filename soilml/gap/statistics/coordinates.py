"""Predictions of a growing model: soil parameters and effect sizes as one vector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.gap.data.observations import Cells
from soilml.identification.free_parameters import FreeParameter
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.effects.base import Effect

Floats = NDArray[np.float64]

#: Step of differences: a share of a soil parameter's prior, or of an effect's reference size.
STEP = 1e-5
#: Prior spread of an effect's two shape coefficients, in their own units.
SHAPE_STD = {"by_slip": 3.0, "by_load": 1.0}


@dataclass(frozen=True)
class Axis:
    """One coordinate of a fit: a parameter's path and how the coordinate x maps to its value.

    A soil parameter's x is its fraction of the prior; an effect's is its size in reference sizes.
    `std` is the spread of a Gaussian prior of x about zero, infinite where there is none.
    """

    path: str
    unit: str
    lower: float
    upper: float
    prior: Prior
    std: float = float("inf")

    def value(self, x: Floats) -> Floats:
        """The parameter's values at coordinates x."""
        return self.prior.at(x)

    def rate(self, x: float) -> float:
        """Derivative of the value."""
        return float(self.prior.rate(np.asarray([x]))[0])


def soil_axis(free: FreeParameter) -> Axis:
    """The coordinate of a soil parameter."""
    return Axis(free.path, free.unit, 0.0, 1.0, free.prior)


def size_axis(effect: type[Effect], calibration: float | None) -> Axis:
    """The coordinate of an effect's size."""
    size = effect.about.size
    parameter = declared(effect)[size]
    unit = effect.about.reference[size]
    lower, upper = sorted((parameter.lower / unit, parameter.upper / unit))
    return Axis(
        f"{effect.name}.{size}",
        parameter.unit,
        lower,
        upper,
        Prior(0.0, unit),
        float("inf") if calibration is None else calibration / abs(unit),
    )


def shape_axes(effect: type[Effect]) -> list[Axis]:
    """The coordinates of an effect's shape, none where its law is certain."""
    found = []
    for name, std in SHAPE_STD.items():
        if name in declared(effect):
            parameter = declared(effect)[name]
            path = f"{effect.name}.{name}"
            bound = min(parameter.upper, 4.0 * std)
            found.append(Axis(path, "1", -bound, bound, Prior(0.0, 1.0), std))
    return found


def predicted(case: Case, axes: Sequence[Axis], x: Floats, cells: Cells) -> Floats:
    """Predictions (sets, m) at coordinates `x` (sets, p); NaN where there is no equilibrium."""
    values = {axis.path: axis.value(x[:, i])[:, None] for i, axis in enumerate(axes)}
    changed = case.with_values(values) if values else case
    force = changed.model(changed.soil, cells.at)
    shape = (len(x), len(cells.run))
    return cells.of({name: np.broadcast_to(getattr(force, name), shape) for name in cells.channels})


def linearised(case: Case, axes: Sequence[Axis], x: Floats, cells: Cells) -> tuple[Floats, Floats]:
    """Predictions (m,) at `x` (p,) and their derivatives (m, p), from one call of the model."""
    p = len(axes)
    upper = np.asarray([axis.upper for axis in axes])
    step = np.where(x + STEP <= upper, STEP, -STEP)
    sets = np.tile(x, (p + 1, 1))
    sets[np.arange(p), np.arange(p)] += step
    y = predicted(case, axes, sets, cells)
    return y[-1], np.asarray(((y[:-1] - y[-1]) / step[:, None]).T)
