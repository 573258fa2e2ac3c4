"""What no name explains: a smooth remainder, labelled as such."""

from __future__ import annotations

import numpy as np

from soilml.gap.search.candidate_fits import Bench
from soilml.gap.statistics.least_squares import GapFit
from soilml.gap.statistics.score_test import outside
from soilml.gap.statistics.smooth_basis import smooth_columns
from soilml.quantities import column


def remainder(bench: Bench, fit: GapFit) -> dict[str, float]:
    """Size of the smooth part of what a fit leaves, by channel, in sigma.

    The part of the whitened residual that smooth functions of slip and load explain, orthogonal to
    all that soil and named effects can move; beyond chance, so that noise alone gives about nil.
    It says nothing outside the slips and loads that were driven.
    """
    cells, whiten = bench.cells, bench.covariance.whiten
    smooth = smooth_columns(cells)
    found = {}
    for i, name in enumerate(cells.channels):
        here = cells.channel == i
        columns = outside(whiten @ np.where(here[:, None], smooth, 0.0), fit.slope)
        u, s, _ = np.linalg.svd(columns, full_matrices=False)
        basis = u[:, s > 1e-6 * max(float(s[0]), 1e-300)] if s.size else u
        power = float(np.sum((basis.T @ fit.residual) ** 2)) - basis.shape[1]
        found[column(name)] = float(np.sqrt(max(power, 0.0) / max(int(here.sum()), 1)))
    return found
