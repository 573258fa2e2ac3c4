"""Priors: uniform, log-uniform, normal or half-normal between bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np

from soilml.arrays import Floats

#: Standard deviations at which a normal prior ends where no bound of the parameter is nearer.
NORMAL_REACH = 4.0
#: Precision of a uniform distribution over the unit interval: 1 / its variance.
UNIFORM_PRECISION = 12.0

_STANDARD = NormalDist()
_quantile = np.vectorize(_STANDARD.inv_cdf, otypes=[np.float64])


@dataclass(frozen=True, repr=False)
class Prior:
    """Distribution of a parameter between two bounds: uniform, unless stated otherwise.

    lower, upper: Bounds in the unit of the parameter; positive if `log`.
    log: Whether the logarithm is uniform.
    normal_std: Standard deviation of a normal distribution about zero, cut off at the bounds; with
        a lower bound of zero it is half-normal. None where the distribution is uniform.

    Examples
    --------
    >>> import numpy as np
    >>> prior = Prior(0.005, 0.03)
    >>> print(prior.at(np.asarray([0.0, 0.5, 1.0])))
    [0.005  0.0175 0.03  ]
    >>> print(f"{prior.std:.5f}")
    0.00722
    >>> print(Prior.normal(0.2).at(np.asarray([0.16, 0.5, 0.84])).round(2))
    [-0.2  0.   0.2]
    """

    lower: float
    upper: float
    log: bool = False
    normal_std: float | None = None

    def __repr__(self) -> str:
        ends = f"lower={self.lower!r}, upper={self.upper!r}, log={self.log!r}"
        normal = "" if self.normal_std is None else f", normal_std={self.normal_std!r}"
        return f"Prior({ends}{normal})"

    @staticmethod
    def normal(std: float) -> Prior:
        """Normal with mean zero."""
        return Prior(-NORMAL_REACH * std, NORMAL_REACH * std, normal_std=std)

    @staticmethod
    def half_normal(std: float) -> Prior:
        """The positive half of a normal distribution with mean zero."""
        return Prior(0.0, NORMAL_REACH * std, normal_std=std)

    def at(self, fraction: Floats) -> Floats:
        """Quantiles at `fraction` (...), probabilities from 0 to 1."""
        if self.normal_std is not None:
            below, mass = self._normal_mass(self.normal_std)
            z = _quantile(np.clip(below + mass * np.asarray(fraction), 1e-16, 1.0 - 1e-16))
            return np.asarray(np.clip(self.normal_std * z, self.lower, self.upper))
        if self.log:
            return np.asarray(self.lower * (self.upper / self.lower) ** fraction)
        return np.asarray(self.lower + (self.upper - self.lower) * fraction)

    def fraction(self, value: float) -> float:
        """Cumulative probability of a value, from 0 to 1."""
        if self.normal_std is not None:
            start, mass = self._normal_mass(self.normal_std)
            below = (_STANDARD.cdf(value / self.normal_std) - start) / mass
        elif self.log:
            below = math.log(max(value, 1e-300) / self.lower) / math.log(self.upper / self.lower)
        else:
            below = (value - self.lower) / (self.upper - self.lower)
        return min(max(below, 0.0), 1.0)

    def rate(self, fraction: Floats) -> Floats:
        """Derivative of `at` by `fraction`, (...)."""
        if self.normal_std is not None:
            z = self.at(fraction) / self.normal_std
            mass = self._normal_mass(self.normal_std)[1]
            return np.asarray(self.normal_std * mass * np.sqrt(2.0 * np.pi) * np.exp(0.5 * z**2))
        if self.log:
            return np.asarray(self.at(fraction) * math.log(self.upper / self.lower))
        return np.full_like(fraction, self.upper - self.lower)

    @property
    def std(self) -> float:
        """Standard deviation."""
        return float(np.std(self.at((np.arange(4096) + 0.5) / 4096)))

    @property
    def fraction_precision(self) -> float:
        """Precision of the normal distribution, in fractions, that stands for the prior.

        That of the uniform distribution of fractions; for a normal prior, the one that gives its
        standard deviation back where values are linear in fractions about the middle.
        """
        if self.normal_std is None:
            return UNIFORM_PRECISION
        return float((self.rate(np.asarray([0.5]))[0] / self.std) ** 2)

    def as_setting(self) -> Any:
        """As it is written in TOML."""
        if self.normal_std is not None:
            return {"normal" if self.lower < 0.0 else "half-normal": self.normal_std}
        if self.log:
            return {"range": [self.lower, self.upper], "scale": "log"}
        return [self.lower, self.upper]

    def _normal_mass(self, std: float) -> tuple[float, float]:
        """Probability of the whole normal distribution below the bounds, and between them."""
        below = _STANDARD.cdf(self.lower / std)
        return below, _STANDARD.cdf(self.upper / std) - below
