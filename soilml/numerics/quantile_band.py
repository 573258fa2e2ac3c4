"""Median and central 90 % interval of draws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Fractions of the draws below the lower end, the median and the upper end of the band.
QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class QuantileBand:
    """Median of the draws and the ends of their central 90 % interval; arrays of one shape."""

    lower: Floats
    middle: Floats
    upper: Floats

    @property
    def width(self) -> Floats:
        """Upper minus lower end."""
        return np.asarray(self.upper - self.lower)


def quantile_band(draws: Floats) -> QuantileBand:
    """Median and central 90 % interval of `draws` (n, ...) along the first axis.

    Draws that are not a number are ignored; where all are, the band is NaN.
    """
    defined = np.isfinite(draws).any(axis=0)
    filled = np.where(defined, draws, 0.0)
    return QuantileBand(*np.where(defined, np.nanquantile(filled, QUANTILES, axis=0), np.nan))
