"""The result of an identification."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.quantities import Z_90

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Fit:
    """Estimates of p parameters with their covariance and warnings.

    `std` is the expected distance between estimate and true value, given the rows, the noise of the
    sensors and the prior. For a parameter that the rows do not determine it can exceed the prior's
    standard deviation: an estimate of least squares may then lie anywhere in the prior.

    Attributes
    ----------
    method
        Name of the method, a key of `METHODS`.
    names, units
        Parameter paths and their SI units, p each.
    values
        Estimates (p,) in SI units.
    covariance
        Covariance (p, p) of the errors of `values`.
    warnings
        What limits the result; one sentence each.
    rows_used
        Number of rows.
    remaining_fraction
        By parameter, its standard deviation after the measurement over that of the prior: 1 where
        the rows are uninformative. Empty for methods without a prior. `left_of_prior` in JSON.
    misfit
        Mean squared residual in standard deviations of the noise, per degree of freedom; NaN where
        the noise is not declared.
    channels
        Columns that were fitted.
    low, high
        Ends (p,) of the 90 % interval where the method computes them, as the posterior does.
    """

    method: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Floats
    covariance: Floats
    warnings: tuple[str, ...]
    rows_used: int
    remaining_fraction: dict[str, float] = field(default_factory=dict)
    misfit: float = float("nan")
    channels: tuple[str, ...] = ()
    low: Floats | None = None
    high: Floats | None = None

    @property
    def interval(self) -> tuple[Floats, Floats]:
        """Ends (p,) of the 90 % interval; Gaussian where the method does not compute them."""
        if self.low is None or self.high is None:
            return self.values - Z_90 * self.std, self.values + Z_90 * self.std
        return self.low, self.high

    @property
    def std(self) -> Floats:
        """Standard deviations (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Floats:
        """Correlations (p, p)."""
        return np.asarray(self.covariance / np.outer(self.std, self.std))

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.names.index(name)])

    def as_json(self) -> dict[str, Any]:
        """The content of the file that `soilml identify` writes."""
        rows = zip(self.names, self.values, self.std, *self.interval, self.units, strict=True)
        remaining, correlation = self.remaining_fraction, self.correlation
        return {
            "method": self.method,
            "parameters": {
                name: {"value": float(v), "std": float(s), "p05": float(low), "p95": float(high)}
                | {"unit": unit}
                | ({"left_of_prior": remaining[name]} if name in remaining else {})
                for name, v, s, low, high, unit in rows
            },
            "correlation": {
                a: {b: float(correlation[i, j]) for j, b in enumerate(self.names) if j != i}
                for i, a in enumerate(self.names)
            },
            "warnings": list(self.warnings),
            "rows_used": self.rows_used,
            "channels_used": list(self.channels),
            "misfit": None if np.isnan(self.misfit) else float(self.misfit),
        }
