"""What the returned model contains: an explanation with its remainder, or the soil alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.least_squares import Solution
from soilml.gap.evidence.problem import FitProblem, MarginalFit
from soilml.gap.verdict.remainder import posterior_discrepancy
from soilml.gap.verdict.remainder_lengths import with_fitted_lengths


def returned_model(
    problem: FitProblem, soil: Solution, options: Sequence[MarginalFit], stated: bool
) -> tuple[FitProblem, MarginalFit]:
    """The first of several explanations that is nearer to the fitted rows than the soil alone.

    Beside its remainder, but without the scatter between runs, which a model does not have. Scatter
    that is granted to all runs alike can cancel an effect that grows during the campaign, or a
    remainder. Where all are farther away, it is the soil alone, with the last one's uncertainty.

    soil: The soil alone, fitted under noise and scatter.
    stated: Whether the first one is stated as the cause: then it is taken.
    """
    for option in options:
        own, written = with_fitted_lengths(problem, option)
        if stated:
            return own, written
        if not (written.evidence.amplitude.any() or written.fit.effects):
            break
        predicted = written.fit.prediction + posterior_discrepancy(own, written)
        if _distance(problem, predicted) <= _distance(problem, soil.prediction):
            return own, written
    nothing = np.zeros_like(written.evidence.amplitude)
    return own, replace(written, fit=soil, evidence=replace(written.evidence, amplitude=nothing))


def _distance(problem: FitProblem, predicted: Floats) -> float:
    """Sum of squared residuals (m,) in variances of the noise."""
    residual = (problem.readings.measured - predicted) / problem.covariance.std
    return float(residual @ residual)
