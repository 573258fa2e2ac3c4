"""The model's torque at fixed rows, as a polynomial of the soil, to far below its noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification.free_parameters import FreeParameter
from soilml.identification.observations import Observations
from soilml.identification.predictions import predicted

Floats = NDArray[np.float64]

#: Nodes along each parameter, points that the polynomial is checked at, and what it may be off.
NODES = 10
CHECKED = 64
TOLERANCE = 2e-4


@dataclass(frozen=True)
class Polynomial:
    """Torques of rows (r,) by coefficients (NODES^p, r) of products of Chebyshev polynomials."""

    coefficients: Floats

    def at(self, u: Floats) -> Floats:
        """Torques (n, r), N m, at fractions of the priors (n, p)."""
        basis = np.ones((len(u), 1))
        for along in u.T:
            own = chebvander(2.0 * along - 1.0, NODES - 1)
            basis = (basis[:, :, None] * own[:, None, :]).reshape(len(u), -1)
        return np.asarray(basis @ self.coefficients)


def interpolated(case: Case, data: Observations, free: Sequence[FreeParameter]) -> Polynomial:
    """The polynomial through the model's torques at the Chebyshev nodes of the priors' box.

    A posterior takes ten thousand soils a row; this asks the model for a thousand. Raises
    `FitError` where it is off by more than `TOLERANCE` of a torque at points between, a hundredth
    of 2 % noise. References: Trefethen, Approximation Theory and Approximation Practice, 2013.
    """
    p = len(free)
    node = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
    fraction = 0.5 * (1.0 + node)
    grid = np.stack(np.meshgrid(*[fraction] * p, indexing="ij"), axis=-1).reshape(-1, p)
    values = predicted(case, free, grid, data.at)["torque"]
    inverse = np.linalg.inv(chebvander(node, NODES - 1))
    cube = values.reshape(*[NODES] * p, -1)
    for axis in range(p):
        cube = np.moveaxis(np.tensordot(inverse, cube, axes=(1, axis)), 0, axis)
    found = Polynomial(cube.reshape(NODES**p, -1))
    u = np.random.default_rng(0).random((CHECKED, p))
    true = predicted(case, free, u, data.at)["torque"]
    off = float(np.max(np.abs(found.at(u) / true - 1.0)))
    if not off < TOLERANCE:
        raise FitError(f"the torque is no smooth function of the soil here: off by {off:.1e}")
    return found
