"""Quantiles: the central 90 % interval of draws, and those of the chi-squared distribution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.report.numbers import format_band

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

    def text(self, unit: str = "1", digits: int = 3) -> str:
        """A single band in words; `unit` and `digits` as in `format_band`."""
        low, middle, high = (float(part) for part in (self.lower, self.middle, self.upper))
        return format_band(low, middle, high, unit, digits)


def quantile_band(draws: Floats) -> QuantileBand:
    """Median and central 90 % interval of `draws` (n, ...) along the first axis.

    Draws that are not a number are ignored; where all are, the band is NaN.
    """
    defined = np.isfinite(draws).any(axis=0)
    filled = np.where(defined, draws, 0.0)
    return QuantileBand(*np.where(defined, np.nanquantile(filled, QUANTILES, axis=0), np.nan))


def band_columns(name: str, draws: Floats) -> dict[str, Floats]:
    """Columns of the median and the 90 % band of draws (n, ...): NAME, NAME_p05, NAME_p95."""
    band = quantile_band(draws)
    return {name: band.middle, f"{name}_p05": band.lower, f"{name}_p95": band.upper}


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
