"""Errors of the printed relations on known soils (Comin and Saaj 2017, table VIII)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from soilml.arrays import Floats

_Soils = tuple[float, float, float, float]


@final
@dataclass(frozen=True)
class SoilErrors:
    """Errors of friction angle and normal stiffness in %, as printed.

    friction, stiffness: Mean errors on SSC-1, SSC-2, SSC-3 and ES-3. All strides on a soil share
        them, so that more strides do not lessen them.
    scatter: Standard deviations of both over the strides on all soils, which weigh the sensors.
    """

    friction: _Soils
    stiffness: _Soils
    scatter: tuple[float, float]

    @property
    def shares(self) -> Floats:
        """Mean errors as shares of the estimate, (2, soils)."""
        return 0.01 * np.asarray([self.friction, self.stiffness])

    def covariance(self, friction_angle: float, normal_stiffness: float) -> Floats:
        """Covariance (2, 2) of the error that a soil's strides share, about these estimates."""
        errors = self.shares * np.asarray([[friction_angle], [normal_stiffness]])
        return np.asarray(errors @ errors.T / errors.shape[1])


def correlation_of(sensors: list[SoilErrors], name: int) -> Floats:
    """Correlation (m, m) of the errors by soil of sensors: of the angle (0) or stiffness (1)."""
    errors = np.stack([one.shares[name] for one in sensors])
    size = np.sqrt((errors**2).sum(axis=1))
    return np.asarray(errors @ errors.T / np.outer(size, size))


#: By relation. The table has no row for torque by "terramechanics", for which EMPIRICAL stands.
EMPIRICAL = SoilErrors((-1, 4, 27, 28), (29, -2, -134, 28), (14.0, 49.0))
SIMPLIFIED = SoilErrors((-7, -9, 21, 4), (36, -6, -92, -11), (14.0, 54.0))
PLANAR = SoilErrors((6, -5, 20, 18), (59, -25, -36, -46), (9.0, 24.0))
LINEAR = SoilErrors((1, 3, 5, 23), (-27, -50, -4, -78), (14.0, 27.0))
SINKAGE = SoilErrors((-17, -8, 4, 2), (30, 24, -5, -17), (9.0, 24.0))
