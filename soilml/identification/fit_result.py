"""The answer of an identification."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.quantities import Z_90

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Fit:
    """Values, their covariance, and what the user should know before believing them.

    `std` is the expected distance between value and truth, given the rows, the sensors' noise and
    the prior. Where the rows leave a parameter open it is larger than the prior's own: the value of
    least squares then stands anywhere in the prior, often at its end, and the truth elsewhere.
    """

    method: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Floats  # (p,)
    covariance: Floats  # (p, p)
    warnings: tuple[str, ...]
    rows_used: int
    #: width that the rows leave of the prior, 1 where they tell nothing; empty without a prior
    left: dict[str, float] = field(default_factory=dict)
    #: mean squared residual in standard deviations of the noise, per degree of freedom
    misfit: float = float("nan")
    channels: tuple[str, ...] = ()
    #: ends of the 90 % interval, (p,), where the method knows them; else +- `Z_90` std holds it
    low: Floats | None = None
    high: Floats | None = None

    @property
    def interval(self) -> tuple[Floats, Floats]:
        """Ends of the 90 % interval, (p,)."""
        if self.low is None or self.high is None:
            return self.values - Z_90 * self.std, self.values + Z_90 * self.std
        return self.low, self.high

    @property
    def std(self) -> Floats:
        """Standard deviations, (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Floats:
        """Correlations, (p, p)."""
        return np.asarray(self.covariance / np.outer(self.std, self.std))

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.names.index(name)])

    def as_json(self) -> dict[str, Any]:
        """The content of the file that `soilml identify` writes."""
        rows = zip(self.names, self.values, self.std, *self.interval, self.units, strict=True)
        correlation = self.correlation
        return {
            "method": self.method,
            "parameters": {
                name: {"value": float(v), "std": float(s), "p05": float(low), "p95": float(high)}
                | {"unit": unit}
                | ({"left_of_prior": self.left[name]} if name in self.left else {})
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
