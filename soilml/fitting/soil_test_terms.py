"""Plate and shear tests of the soil as terms of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.physics.soils.soil_tests import deviation_rates, deviations

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SoilTestTerms:
    """Deviations of the soil from the tests of a case, at coordinates of a fit.

    Each is a residual of unit variance beside those of the readings. It has neither discrepancy nor
    scatter from run to run: its own scatter contains that from place to place.
    """

    case: Case | None = None
    coordinates: Sequence[Coordinate] = ()

    def deviation(self, x: Floats) -> Floats:
        """Deviations (..., t) at coordinates x (..., p), in standard deviations."""
        if self.case is None or not self.case.soil_tests:
            return np.zeros((*x.shape[:-1], 0))
        values = np.stack([c.value(x[..., i]) for i, c in enumerate(self.coordinates)], axis=-1)
        names = [c.path for c in self.coordinates]
        return deviations(self.case.soil_tests, self.case.soil, names, values)

    def rates(self, x: Floats) -> Floats:
        """Derivatives (t, p) of the deviations at coordinates x (p,)."""
        if self.case is None or not self.case.soil_tests:
            return np.zeros((0, len(x)))
        values = np.asarray([c.value(x[i : i + 1])[0] for i, c in enumerate(self.coordinates)])
        names = [c.path for c in self.coordinates]
        rates = [c.rate(float(own)) for c, own in zip(self.coordinates, x, strict=True)]
        return deviation_rates(self.case.soil_tests, self.case.soil, names, values) * rates
