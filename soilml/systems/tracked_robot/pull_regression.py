"""How predicted and measured values stand to each other, as papers report it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from soilml.errors import FitError, InputError


@dataclass(frozen=True)
class Regression:
    """A straight line through points, and how much of their spread it explains."""

    slope: float
    slope_std: float
    intercept: float  # in the unit of y
    r2: float
    f: float
    points: int


def regression(x: ArrayLike, y: ArrayLike) -> Regression:
    r"""The line of least squares of y on x, both (n,), three points or more.

    .. math::
        r^2 = \frac{S_{xy}^2}{S_{xx} S_{yy}}, \quad F = \frac{r^2}{1 - r^2} (N - 2), \quad
        s_a = \sqrt{\frac{S_{yy} (1 - r^2)}{(N - 2) S_{xx}}}

    High r2 and F say that the two run together, not that they agree: slope 1 and intercept 0 say
    that. References: Draper and Smith, Applied Regression Analysis, ch. 1; reported by Wang et al.
    2018, section 4.2.2. `slope_std` takes the points for independent and x for free of error.
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
        raise FitError("all points have one x, or one y: there is no line to speak of")
    r2, freedom = xy * xy / (xx * yy), len(a) - 2
    left = max(1.0 - r2, 0.0)
    return Regression(
        slope=xy / xx,
        slope_std=math.sqrt(yy * left / (freedom * xx)),
        intercept=float(b.mean() - xy / xx * a.mean()),
        r2=r2,
        f=r2 / left * freedom if left > 0.0 else math.inf,
        points=len(a),
    )


def points_behind(r2: float, f: float) -> float:
    """How many points a printed r2 and F of a straight line imply: F (1 - r2) / r2 + 2."""
    if not (0.0 < r2 < 1.0 and f > 0.0):
        raise InputError(f"r2 is {r2:g} and F {f:g}; r2 must lie between 0 and 1, F above 0")
    return f * (1.0 - r2) / r2 + 2.0
