"""Linear regression of measured on predicted values, as reported in papers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from soilml.errors import FitError, InputError


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
    if a.ndim != 1 or a.shape != b.shape:
        raise InputError(
            f"x has the shape {a.shape} and y {b.shape}; two rows of one length needed"
        )
    if len(a) < 3 or not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise InputError(f"{len(a)} points are given; three or more are needed, all of them finite")
    da, db = a - a.mean(), b - b.mean()
    xx, xy, yy = float(da @ da), float(da @ db), float(db @ db)
    if xx == 0.0 or yy == 0.0:
        raise FitError("all points have the same x, or the same y: there is no regression line")
    r2, freedom = xy * xy / (xx * yy), len(a) - 2
    unexplained = max(1.0 - r2, 0.0)
    return Regression(
        slope=xy / xx,
        slope_std=math.sqrt(yy * unexplained / (freedom * xx)),
        intercept=float(b.mean() - xy / xx * a.mean()),
        r2=r2,
        f=r2 / unexplained * freedom if unexplained > 0.0 else math.inf,
        points=len(a),
    )


def implied_points(r2: float, f: float) -> float:
    """Number of points implied by a printed r2 and F of a line: F (1 - r2) / r2 + 2."""
    if not (0.0 < r2 < 1.0 and f > 0.0):
        raise InputError(f"r2 is {r2:g} and F {f:g}; r2 must lie between 0 and 1, F above 0")
    return f * (1.0 - r2) / r2 + 2.0
