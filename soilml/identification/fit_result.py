"""The result of an identification."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.prior import Prior
from soilml.quantities import Z_90
from soilml.remarks import Remark

if TYPE_CHECKING:
    from soilml.report.parameter_figure import ParameterIntervals

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
        What limits the result.
    rows_used
        Number of rows.
    remaining_fraction
        By parameter, its standard deviation after the measurement over that of the prior: 1 where
        the rows are uninformative. Empty for methods without a prior.
    misfit
        Mean squared residual in standard deviations of the noise, per degree of freedom; NaN where
        the noise is not declared.
    channels
        Columns that were fitted.
    low, high
        Ends (p,) of the 90 % interval where the method computes them, as the posterior does, and
        where Gaussian ones would reach beyond the priors.
    samples
        Weighted samples of the posterior (`soilml.identification.posterior.PosteriorSamples`),
        where the method drew them.
    """

    method: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Floats
    covariance: Floats
    warnings: tuple[Remark, ...]
    rows_used: int
    remaining_fraction: dict[str, float] = field(default_factory=dict)
    misfit: float = float("nan")
    channels: tuple[str, ...] = ()
    low: Floats | None = None
    high: Floats | None = None
    samples: Any = field(default=None, repr=False, compare=False)

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

    def intervals(
        self, prior: Mapping[str, Prior] | None = None, label: str = ""
    ) -> ParameterIntervals:
        """Values and 90 % intervals for a figure, with the ranges of their priors where given."""
        from soilml.report.parameter_figure import ParameterIntervals

        ends = [
            (np.nan, np.nan) if prior is None or name not in prior else _ends(prior[name])
            for name in self.names
        ]
        low, high = np.asarray(ends, dtype=np.float64).reshape(-1, 2).T
        values, own = self.values[None], self.interval
        return ParameterIntervals(
            self.names, self.units, (label,), values, own[0][None], own[1][None], low, high
        )

    def plot(self, ax: Any = None, prior: Mapping[str, Prior] | None = None) -> NDArray[Any]:
        """Draw each parameter with its 90 % interval, in usual units (kPa, degrees, mm).

        Parameters
        ----------
        ax
            Axes of matplotlib, one for each parameter; a new figure where None.
        prior
            Priors by parameter, such as those of the case, whose ranges are shaded.

        Returns
        -------
        ndarray of Axes, shape (p,)

        Raises
        ------
        InputError
            For another number of axes.
        """
        return self.intervals(prior).plot(ax)

    def as_json(self) -> dict[str, Any]:
        """The content of the file that `soilml identify` writes."""
        rows = zip(self.names, self.values, self.std, *self.interval, self.units, strict=True)
        remaining, correlation = self.remaining_fraction, self.correlation
        return {
            "method": self.method,
            "parameters": {
                name: {"value": float(v), "std": float(s), "p05": float(low), "p95": float(high)}
                | {"unit": unit}
                | ({"remaining_fraction": remaining[name]} if name in remaining else {})
                for name, v, s, low, high, unit in rows
            },
            "correlation": {
                a: {b: float(correlation[i, j]) for j, b in enumerate(self.names) if j != i}
                for i, a in enumerate(self.names)
            },
            "warnings": [remark.as_json() for remark in self.warnings],
            "rows_used": self.rows_used,
            "channels_used": list(self.channels),
            "misfit": None if np.isnan(self.misfit) else float(self.misfit),
        }


def _ends(prior: Prior) -> tuple[float, float]:
    """Ends of the central 99 % of a normal prior; those of any other."""
    if prior.normal_std is None:
        return prior.lower, prior.upper
    low, high = prior.at(np.asarray([0.005, 0.995]))
    return float(low), float(high)
