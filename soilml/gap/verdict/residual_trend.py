"""Smooth trend of the residuals that no effect of the catalogue explains."""

from __future__ import annotations

import numpy as np

from soilml.fitting.least_squares import Solution
from soilml.gap.search.problem import FitProblem
from soilml.gap.statistics.smooth_basis import smooth_basis
from soilml.numerics.subspaces import column_space, project_out
from soilml.quantities import column

#: Smooth functions of which less than this fraction is outside the span of the fit are dropped.
MIN_RELATIVE_SINGULAR_VALUE = 1e-6


def residual_trend(problem: FitProblem, fit: Solution) -> dict[str, float]:
    """Root mean square of the smooth trend of a fit's residuals, by channel, in sigma.

    The component of the whitened residual that smooth functions of slip and load explain and that
    soil and named effects cannot. The expectation under noise alone is subtracted. The trend does
    not extrapolate beyond the slips and loads of the data.
    """
    readings, whiten = problem.readings, problem.covariance.whiten
    fit = fit.whitened_by(whiten)
    smooth = smooth_basis(readings)
    trend = {}
    for i, name in enumerate(readings.channels):
        in_channel = readings.channel == i
        own = whiten @ np.where(in_channel[:, None], smooth, 0.0)
        basis = column_space(
            project_out(own, fit.jacobian), relative_tolerance=MIN_RELATIVE_SINGULAR_VALUE
        )
        power = float(np.sum((basis.T @ fit.residual) ** 2)) - basis.shape[1]
        trend[column(name)] = float(np.sqrt(max(power, 0.0) / max(int(in_channel.sum()), 1)))
    return trend
