"""One unknown of the soil as a coordinate between -1 and 1."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.prior import Prior

Floats = NDArray[np.float64]

#: A range that reaches down to less than this share of its upper end is taken to begin at zero.
FROM_ZERO = 0.1
#: Ends of a range that begins at zero count as this far apart.
SPREAD = 4.0
#: Ends further apart than this have a logarithmic coordinate.
WIDE = 1.5


@dataclass(frozen=True)
class Coordinate:
    r"""A parameter's value along its coordinate x, and the density of its prior there.

    .. math:: \theta = \alpha + \beta e^{\gamma x} + \delta x, \qquad \log p(x) = \lambda x + const

    Torque bends with shear modulus and cohesion as logarithms do: along these coordinates a
    polynomial of low degree follows it closely.
    """

    name: str
    shift: float
    factor: float
    rate: float
    slope: float
    tilt: float

    @staticmethod
    def of(name: str, prior: Prior) -> Coordinate:
        """The coordinate for a prior, uniform in the value or in its logarithm."""
        lower, upper = prior.lower, prior.upper
        if prior.log or (lower > 0.0 and upper / lower > WIDE and lower > FROM_ZERO * upper):
            rate = 0.5 * math.log(upper / lower)
            middle = math.sqrt(lower * upper)
            return Coordinate(name, 0.0, middle, rate, 0.0, 0.0 if prior.log else rate)
        if 0.0 <= lower <= FROM_ZERO * upper:
            rate, size = 0.5 * math.log(SPREAD), (upper - lower) / (SPREAD - 1.0)
            return Coordinate(name, lower - size, size * math.sqrt(SPREAD), rate, 0.0, rate)
        return Coordinate(name, 0.5 * (lower + upper), 0.0, 0.0, 0.5 * (upper - lower), 0.0)

    def value(self, x: Floats) -> Floats:
        """The parameter at coordinates x, of any shape."""
        return np.asarray(self.shift + self.factor * np.exp(self.rate * x) + self.slope * x)

    def quantile(self, u: Floats) -> Floats:
        """Coordinates below which fractions u of the prior lie."""
        if self.tilt == 0.0:
            return np.asarray(2.0 * u - 1.0)
        low, high = math.exp(-self.tilt), math.exp(self.tilt)
        return np.asarray(np.log(low + (high - low) * u) / self.tilt)

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end of the range."""
        low, high = self.value(np.asarray([-1.0, 1.0]))
        return float(low), float(high)

    @property
    def log_density(self) -> float:
        """Log of the prior's density at x = 0."""
        return (
            math.log(0.5) if self.tilt == 0.0 else math.log(0.5 * self.tilt / math.sinh(self.tilt))
        )
