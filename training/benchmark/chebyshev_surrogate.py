"""Chebyshev interpolation of the model's torque over the prior box, at fixed slips and loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.fitting.channel_predictions import predict_channels
from soilml.fitting.free_parameters import FreeParameter
from soilml.fitting.observations import Observations

Floats = NDArray[np.float64]

#: Interpolation nodes along each parameter: 1000 evaluations of the model for three parameters,
#: against the ten thousand and more that posterior sampling needs.
NODES = 10
#: Random points that the surrogate is verified at, and the largest relative error accepted there,
#: a hundredth of 2 % noise.
CHECK_POINTS = 64
TOLERANCE = 2e-4


@dataclass(frozen=True)
class ChebyshevSurrogate:
    """Torques of r rows: coefficients (NODES^p, r) of tensor products of Chebyshev polynomials."""

    coefficients: Floats

    def torque(self, u: Floats) -> Floats:
        """Torques (n, r), N m, at fractions of the priors (n, p)."""
        basis = np.ones((len(u), 1))
        for fraction in u.T:
            polynomials = chebvander(2.0 * fraction - 1.0, NODES - 1)
            basis = (basis[:, :, None] * polynomials[:, None, :]).reshape(len(u), -1)
        return np.asarray(basis @ self.coefficients)


def fit_chebyshev_surrogate(
    case: Case, data: Observations, free: Sequence[FreeParameter]
) -> ChebyshevSurrogate:
    """Interpolate the model's torques at the Chebyshev nodes of the prior box.

    Raises `FitError` where the relative error exceeds `TOLERANCE` at a check point: the torque is
    then not smooth over the prior.

    References
    ----------
    Trefethen, Approximation Theory and Approximation Practice, SIAM, 2013.
    """
    p = len(free)
    node = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
    fraction = 0.5 * (1.0 + node)
    grid = np.stack(np.meshgrid(*[fraction] * p, indexing="ij"), axis=-1).reshape(-1, p)
    values = predict_channels(case, free, grid, data.at)["torque"]
    inverse = np.linalg.inv(chebvander(node, NODES - 1))
    cube = values.reshape(*[NODES] * p, -1)
    for axis in range(p):
        cube = np.moveaxis(np.tensordot(inverse, cube, axes=(1, axis)), 0, axis)
    surrogate = ChebyshevSurrogate(cube.reshape(NODES**p, -1))
    u = np.random.default_rng(0).random((CHECK_POINTS, p))
    true = predict_channels(case, free, u, data.at)["torque"]
    error = float(np.max(np.abs(surrogate.torque(u) / true - 1.0)))
    if not error < TOLERANCE:
        raise FitError(
            f"the torque is not a smooth function of the soil here: relative error {error:.1e}, "
            f"needed is less than {TOLERANCE:.1e}"
        )
    return surrogate
