"""Quantiles: the central 90 % interval of draws, and those of the chi-squared distribution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats

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


def chi_squared_quantile(degrees: float, normal_quantile: float) -> float:
    r"""The chi-squared value that is exceeded as rarely as a normal variable exceeds z.

    .. math:: n \left(1 - \frac{2}{9 n} + z \sqrt{\frac{2}{9 n}}\right)^3

    with n degrees of freedom, 0.5 or more. At z of 3 to 4 it is up to a tenth too large for one
    degree of freedom, and closer for more.

    References: Wilson and Hilferty, Proc. Natl. Acad. Sci. 17, 1931.

    Examples
    --------
    >>> round(chi_squared_quantile(20.0, 3.09), 1)  # exact: 45.31
    45.4
    """
    part = 2.0 / (9.0 * degrees)
    return float(degrees * (1.0 - part + normal_quantile * part**0.5) ** 3)
