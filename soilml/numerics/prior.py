"""Priors: uniform or log-uniform between bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Prior:
    """Uniform distribution between two bounds, of the value or of its logarithm.

    Attributes
    ----------
    lower, upper
        Bounds in the unit of the parameter; positive if `log`.
    log
        Whether the logarithm is uniform.

    Examples
    --------
    >>> import numpy as np
    >>> prior = Prior(0.005, 0.03)
    >>> print(prior.at(np.asarray([0.0, 0.5, 1.0])))
    [0.005  0.0175 0.03  ]
    >>> print(f"{prior.std:.5f}")
    0.00722
    """

    lower: float
    upper: float
    log: bool = False

    def at(self, fraction: Floats) -> Floats:
        """Quantiles at `fraction` (...), probabilities from 0 to 1."""
        if self.log:
            return np.asarray(self.lower * (self.upper / self.lower) ** fraction)
        return np.asarray(self.lower + (self.upper - self.lower) * fraction)

    def fraction(self, value: float) -> float:
        """Cumulative probability of a value, from 0 to 1."""
        if self.log:
            below = math.log(max(value, 1e-300) / self.lower) / math.log(self.upper / self.lower)
        else:
            below = (value - self.lower) / (self.upper - self.lower)
        return min(max(below, 0.0), 1.0)

    def rate(self, fraction: Floats) -> Floats:
        """Derivative of `at` by `fraction`, (...)."""
        if self.log:
            return np.asarray(self.at(fraction) * math.log(self.upper / self.lower))
        return np.full_like(fraction, self.upper - self.lower)

    @property
    def std(self) -> float:
        """Standard deviation."""
        return float(np.std(self.at((np.arange(4096) + 0.5) / 4096)))

    def as_setting(self) -> Any:
        """As it is written in TOML."""
        if self.log:
            return {"range": [self.lower, self.upper], "scale": "log"}
        return [self.lower, self.upper]
