"""Scatter between runs that explains the readings better than the effects that were found."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from soilml.gap.evidence.covariance import (
    RUN_EFFECT_UNITS,
    VarianceComponents,
    assemble_covariance,
    run_effect_columns,
)
from soilml.gap.evidence.marginal_likelihood import DiscrepancyModel
from soilml.gap.evidence.problem import FitProblem
from soilml.gap.search.stepwise import SearchResult

#: Scatter of friction angle and bearing that is tried, at least, in units of `RUN_EFFECT_UNITS`.
SIZES = (0.0, 1.0, 2.0, 4.0)
#: Scatter of soils that are prepared alike, in these units: the mean of its prior.
USUAL_SIZE = 1.0
#: Decrease of -2 ln of the evidence from which a larger scatter replaces the estimated one:
#: odds of 7 to 1.
LIKELIER = 4.0
#: Explanations, the likeliest first, that are compared beside the soil alone.
COMPARED = 3


def with_likelier_scatter(problem: FitProblem, result: SearchResult) -> FitProblem | None:
    r"""The problem with a larger scatter, where the evidence is better with it.

    .. math:: -2 \ln p(y, \sigma) = \min_M [-2 \ln p(y \mid M, \sigma)] - 2 \ln p(\sigma)

    over the explanations M that are compared, with the determinant of the covariance of noise and
    scatter sigma, which fits under one covariance share.

    Scatter is estimated from what soil, effects and their signatures leave. Where the signatures
    that differ from run to run are hardly fewer than the runs, nothing is left: none is found, and
    such an effect takes what scatter did. The evidence of the soil alone and of the likeliest
    explanations tells, where one of them has such an effect. None where the estimated scatter is as
    good.

    References: MacKay, Bayesian Interpolation, Neural Computation 4(3), 1992, section 2.
    """
    alone, first = result.soil_alone, (result.likeliest, *result.accepted[:1])
    if alone is None:
        return None
    names = {name for c in first if c is not None for name in c.names}
    cards = [problem.effects[name].about for name in names]
    if not any(card.needs or card.uses for card in cards):
        return None
    known = problem.covariance.components
    columns = run_effect_columns(result.soil.fitted(), problem.readings)
    compared = [alone, *[c for c in result.candidates if c.names][:COMPARED]]
    tried = [known, *(_scattered(known, *sizes) for sizes in product(SIZES, SIZES))]
    covariances = [assemble_covariance(problem.readings, columns, own) for own in tried]
    values = []
    for own, covariance in zip(tried, covariances, strict=True):
        model = DiscrepancyModel(covariance, problem.discrepancy.process)
        evidence = min(model.evidence(c.fit, c.amplitude).value + c.penalty for c in compared)
        log_determinant = -2.0 * float(np.log(np.diag(covariance.whiten)).sum())
        values.append(evidence + log_determinant + _prior(own))
    best = int(np.argmin(values))
    if values[best] > values[0] - LIKELIER:
        return None
    return replace(problem, covariance=covariances[best])


def _scattered(known: VarianceComponents, angle: float, bearing: float) -> VarianceComponents:
    """The components with at least this scatter, in `RUN_EFFECT_UNITS`."""
    angle *= RUN_EFFECT_UNITS["friction_angle"]
    bearing *= RUN_EFFECT_UNITS["bearing"]
    return replace(
        known,
        friction_angle_std=max(known.friction_angle_std, angle),
        bearing_std=max(known.bearing_std, bearing),
    )


def _prior(components: VarianceComponents) -> float:
    """-2 ln of the prior density of a scatter, which falls exponentially, but for a constant."""
    angle = components.friction_angle_std / RUN_EFFECT_UNITS["friction_angle"]
    bearing = components.bearing_std / RUN_EFFECT_UNITS["bearing"]
    return 2.0 * float(angle + bearing) / USUAL_SIZE
