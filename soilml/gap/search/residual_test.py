"""The test of what a fit leaves: whether noise, scatter and a declared discrepancy explain it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.effect_signatures import Signature
from soilml.fitting.least_squares import Solution
from soilml.gap.evidence.directions import smooth_basis
from soilml.gap.evidence.problem import FitProblem, within_bounds
from soilml.gap.evidence.score_test import ScoreTest, score_test
from soilml.gap.search.explanation import shape_directions


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
    problem: FitProblem,
    fit: Solution,
    signatures: Sequence[Signature],
    seed: int,
    *,
    within_priors: bool = False,
) -> ResidualTest:
    """Test the residuals of a fit against noise, scatter and the declared discrepancy, if any.

    All that the coordinates of the fit can explain is projected out, with second-order terms in
    the laws of its effects; see `soilml.gap.search.explanation.shape_directions`. What another
    soil could explain is what its priors and tests of the soil permit: few readings determine some
    changes of it so badly that a line through the fit would explain all by a soil far away.

    within_priors: Do not project out coordinates of the soil that the fit presses against a bound:
        a soil that the priors exclude explains nothing.
    """
    whiten = problem.discrepancy.whiten(problem.declared_amplitude)
    fit = fit.whitened_by(whiten)
    smooth = smooth_basis(problem.readings)
    columns = whiten @ np.column_stack([*[s.column for s in signatures], smooth])
    signs = np.asarray([s.sign for s in signatures] + [0] * smooth.shape[1], dtype=np.float64)
    directions = [whiten @ columns for columns in shape_directions(problem, fit)]
    jacobian = within_bounds(fit) if within_priors else fit.jacobian
    space = np.column_stack([jacobian, *directions])
    # priors and tests of the soil are residuals that no effect changes: a change of the soil costs
    # something; one over a whole prior counts as much as a standard deviation of the noise
    priors = np.diag([0.0 if c.effect else 1.0 for c in fit.coordinates])
    deviation = np.append(fit.soil_tests.deviation(fit.x), np.zeros(len(fit.x)))
    rates = np.vstack([fit.soil_tests.rates(fit.x), priors])
    terms, k = len(deviation), len(fit.x)
    columns = np.vstack([columns, np.zeros((terms, columns.shape[1]))])
    space = np.vstack([space, np.hstack([rates, np.zeros((terms, space.shape[1] - k))])])
    residual = np.append(fit.residual, -deviation)
    test = score_test(
        residual,
        columns=columns,
        space=space,
        signs=signs,
        degrees_of_freedom=problem.covariance.components.degrees_of_freedom,
        seed=seed,
        own_degrees=_degrees_by_runs(problem, signatures, smooth.shape[1]),
    )
    return ResidualTest(tuple(signatures), test)


def _degrees_by_runs(problem: FitProblem, signatures: Sequence[Signature], others: int) -> Floats:
    """Degrees of freedom by which each signature is judged; infinite but for drifts of the soil.

    A drift differs from the scatter of the runs only by its order: a line through them leaves two
    fewer than there are runs.
    """
    left = max(len(problem.readings.runs) - 2, 1)
    drifts = ["progress" in problem.effects[s.name].about.uses for s in signatures]
    return np.asarray([left if drift else np.inf for drift in drifts] + [np.inf] * others)
