"""Standardised inputs and outputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats


@dataclass(frozen=True)
class Standardisation:
    """Mean and standard deviation (d,) of columns; a constant column has the scale 1."""

    mean: Floats
    scale: Floats

    @staticmethod
    def of(values: Floats) -> Standardisation:
        """Mean and standard deviation of rows (n, d)."""
        scale = values.std(axis=0)
        tiny = 1e-12 * np.maximum(np.abs(values).max(axis=0), 1e-300)
        return Standardisation(values.mean(axis=0), np.where(scale > tiny, scale, 1.0))

    def apply(self, values: Floats) -> Floats:
        """Standardised rows."""
        return np.asarray((values - self.mean) / self.scale)

    def undo(self, values: Floats) -> Floats:
        """Rows in their original units."""
        return np.asarray(values * self.scale + self.mean)
