"""Soil parameters from groups of pulls of a tracked robot, averaged, and regressions of pulls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError, InputError
from soilml.fitting.operating_points import operating_points
from soilml.fitting.predictions import forces_of_one_gear
from soilml.identification import Fit, identify
from soilml.identification.fit import identifiability_remarks
from soilml.io.table import Table
from soilml.quantities import CHANNELS, WEAKLY_IDENTIFIED_ABOVE, Z_90, column

#: Parameters that the source identifies from the pull alone, in its order.
PARAMETERS = ("n", "friction_angle", "kphi", "shear_modulus", "cohesion")


@dataclass(frozen=True)
class GroupFits:
    """One fit for each group of data, their average, and one of all rows where it was made.

    Raises `InputError` for fewer than two groups.
    """

    fits: tuple[Fit, ...]
    pooled: Fit | None = None

    def __post_init__(self) -> None:
        _refuse_one(len(self.fits))

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that were free."""
        return self.fits[0].names

    @property
    def values(self) -> Floats:
        """Fitted values of each group, (groups, parameters)."""
        return np.stack([fit.values for fit in self.fits])

    @property
    def mean(self) -> Floats:
        """The average of the groups, (parameters,)."""
        return np.asarray(self.values.mean(axis=0))

    @property
    def std(self) -> Floats:
        r"""Standard deviation of the average, (parameters,).

        .. math:: s^2 = \frac{v}{N} + \max(0, \bar{u} - v)

        with v the variance between the groups and u the variance that each fit reports: the part
        of u that does not appear as scatter is common to all groups and is not reduced by
        averaging.
        """
        between = self.values.var(axis=0, ddof=1)
        reported = np.mean([fit.std**2 for fit in self.fits], axis=0)
        return np.asarray(np.sqrt(between / len(self.fits) + np.maximum(reported - between, 0.0)))

    @property
    def remaining_fraction(self) -> dict[str, float]:
        """Remaining fraction of each prior's width, averaged over the groups."""
        each = [fit.remaining_fraction for fit in self.fits]
        names = (n for n in self.names if all(n in left for left in each))
        return {n: float(np.mean([left[n] for left in each])) for n in names}

    @property
    def unidentified(self) -> tuple[str, ...]:
        """Parameters whose average is determined mostly by the prior."""
        return tuple(
            name
            for name, share in self.remaining_fraction.items()
            if share > WEAKLY_IDENTIFIED_ABOVE
        )

    @property
    def average(self) -> Fit:
        """The average as a fit: its errors, what is left of the priors, and warnings by that.

        Its interval reaches no further than those of the groups, which know their priors.
        """
        first, left = self.fits[0], self.remaining_fraction
        low, high = (
            np.asarray(ends) for ends in zip(*(f.interval for f in self.fits), strict=True)
        )
        return Fit(
            method=f"mean of {len(self.fits)} fits, {first.method}",
            names=self.names,
            units=first.units,
            values=self.mean,
            covariance=np.diag(self.std**2),
            warnings=tuple(
                r for n, share in left.items() for r in identifiability_remarks(n, share)
            ),
            rows_used=sum(fit.rows_used for fit in self.fits),
            remaining_fraction=left,
            channels=first.channels,
            low=np.maximum(self.mean - Z_90 * self.std, low.min(axis=0)),
            high=np.minimum(self.mean + Z_90 * self.std, high.max(axis=0)),
        )


def identify_groups(
    case: Case, tables: Sequence[Table], free: Sequence[str] = PARAMETERS, method: str = "nonlinear"
) -> GroupFits:
    """Fit each table (`slip`, `load_N`, `drawbar_pull_N`), and all rows pooled.

    `method` is `nonlinear`, least squares as in the source, or `posterior`. Raises `InputError` for
    fewer than two groups, `FitError` for rows that cannot be fitted. References: Wang et al. 2018,
    section 4.2.
    """
    _refuse_one(len(tables))
    groups = GroupFits(tuple(identify(case, table, free, method) for table in tables))
    names = [name for name in tables[0].columns if all(name in table for table in tables)]
    rows = {name: np.concatenate([table[name] for table in tables]) for name in names}
    return replace(groups, pooled=identify(case, Table(rows), free, method))


def _refuse_one(count: int) -> None:
    if count < 2:
        raise InputError(f"{count} groups of data are given; an average needs two or more")


def predicted(case: Case, fit: Fit, table: Table, channel: str = "drawbar_pull") -> Floats:
    """A channel (SI units) predicted with the fitted values for the rows of a table, (n,)."""
    fitted = case.with_values(dict(zip(fit.names, fit.values.tolist(), strict=True)))
    return np.asarray(getattr(forces_of_one_gear(fitted, operating_points(table)), channel))


@dataclass(frozen=True)
class Regression:
    """A regression line with its coefficient of determination and F."""

    slope: float
    slope_std: float
    intercept: float  # in the unit of y
    r2: float
    f: float
    points: int


def linear_regression(x: ArrayLike, y: ArrayLike) -> Regression:
    r"""Least-squares line of y on x, both (n,), three points or more.

    .. math::
        r^2 = \frac{S_{xy}^2}{S_{xx} S_{yy}}, \quad F = \frac{r^2}{1 - r^2} (N - 2), \quad
        s_a = \sqrt{\frac{S_{yy} (1 - r^2)}{(N - 2) S_{xx}}}

    High r2 and F show correlation, not agreement, which requires slope 1 and intercept 0.
    `slope_std` is valid for independent points and x without error. Raises `InputError` for
    invalid points, `FitError` if all x or all y are equal. References: Draper and Smith, Applied
    Regression Analysis, ch. 1; reported by Wang et al. 2018, section 4.2.2.

    Examples
    --------
    >>> line = linear_regression([1.0, 2.0, 4.0], [3.0, 5.0, 9.0])
    >>> round(line.slope, 6), round(line.intercept, 6), line.points
    (2.0, 1.0, 3)
    """
    a, b = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if a.ndim != 1 or a.shape != b.shape or len(a) < 3:
        raise InputError(
            f"x has the shape {a.shape} and y {b.shape}; needed are two rows of one length, of "
            "three points or more"
        )
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise InputError("a point is not finite; leave it out")
    xx, xy, yy = np.cov(a, b)[[0, 0, 1], [0, 1, 1]].tolist()
    if xx == 0.0 or yy == 0.0:
        raise FitError("all points have the same x, or the same y: there is no regression line")
    slope, r2, freedom = xy / xx, xy * xy / (xx * yy), len(a) - 2
    left = max(1.0 - r2, 0.0)
    return Regression(
        slope=slope,
        slope_std=math.sqrt(yy * left / (freedom * xx)),
        intercept=float(b.mean() - slope * a.mean()),
        r2=r2,
        f=r2 / left * freedom if left > 0.0 else math.inf,
        points=len(a),
    )


@dataclass(frozen=True)
class ChannelRegression:
    """Measured on predicted values (n,) of a channel, in SI units, and their regression line."""

    predicted: Floats
    measured: Floats
    line: Regression


def regressions(case: Case, fit: Fit, table: Table) -> dict[str, ChannelRegression]:
    """Regression of each channel that the rows measured on what a fit predicts, by column.

    The rows should be others than those of the fit: the line of its own rows tests nothing.
    Raises `InputError` for fewer than three readings of a channel, and where none was measured.
    References: Wang et al. 2018, section 4.2.2.
    """
    found = {}
    for channel in CHANNELS:
        key = column(channel)
        if key not in table or not np.isfinite(table[key]).any():
            continue
        value = predicted(case, fit, table, channel)
        read = np.isfinite(value) & np.isfinite(table[key])
        x, y = value[read], np.asarray(table[key][read], dtype=np.float64)
        found[key] = ChannelRegression(x, y, linear_regression(x, y))
    if not found:
        raise InputError(f"{table.source} has no readings to compare with predictions")
    return found


def implied_points(r2: float, f: float) -> float:
    """Number of points implied by a printed r2 and F of a line: F (1 - r2) / r2 + 2."""
    if not (0.0 < r2 < 1.0 and f > 0.0):
        raise InputError(f"r2 is {r2:g} and F {f:g}; r2 must lie between 0 and 1, F above 0")
    return f * (1.0 - r2) / r2 + 2.0
