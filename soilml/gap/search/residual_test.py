"""Score test of a fit's residuals against the catalogue and smooth functions together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.fitting.least_squares import Solution
from soilml.gap.search.candidate_fits import shape_directions
from soilml.gap.search.problem import FitProblem
from soilml.gap.statistics.score_test import ScoreTest, score_test
from soilml.gap.statistics.signatures import Signature
from soilml.gap.statistics.smooth_basis import smooth_basis


@dataclass(frozen=True)
class ResidualTest:
    """Score test of a fit's residuals, and the signatures against which they were tested."""

    signatures: tuple[Signature, ...]
    test: ScoreTest

    @property
    def p_value(self) -> float:
        """Family-wise p value of the largest score."""
        return self.test.family_wise_p


def residual_test(
    problem: FitProblem, fit: Solution, signatures: Sequence[Signature], seed: int
) -> ResidualTest:
    """Test the residuals of a fit against noise, scatter and the declared discrepancy, if any.

    All that the coordinates of the fit can explain is projected out, with second-order terms in
    the laws of its effects; see `soilml.gap.search.candidate_fits.shape_directions`. What another
    soil could explain is, with tests of the soil, what these permit.
    """
    whiten = problem.discrepancy.whiten(problem.declared_amplitude)
    fit = fit.whitened_by(whiten)
    smooth = smooth_basis(problem.readings)
    columns = whiten @ np.column_stack([*[s.column for s in signatures], smooth])
    signs = np.asarray([s.sign for s in signatures] + [0] * smooth.shape[1], dtype=np.float64)
    directions = [whiten @ columns for columns in shape_directions(problem, fit)]
    space = np.column_stack([fit.jacobian, *directions])
    # tests of the soil are residuals that no effect changes: a change of the soil costs something
    deviation, rates = fit.soil_tests.deviation(fit.x), fit.soil_tests.rates(fit.x)
    tests, k = len(deviation), len(fit.x)
    columns = np.vstack([columns, np.zeros((tests, columns.shape[1]))])
    space = np.vstack([space, np.hstack([rates, np.zeros((tests, space.shape[1] - k))])])
    residual = np.append(fit.residual, -deviation)
    degrees_of_freedom = problem.covariance.components.degrees_of_freedom
    test = score_test(residual, columns, space, signs, degrees_of_freedom, seed)
    return ResidualTest(tuple(signatures), test)
