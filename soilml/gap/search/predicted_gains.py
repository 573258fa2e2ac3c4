"""Gains that effects should achieve, linearised at a fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.fitting.least_squares import Solution
from soilml.gap.search.candidate_fits import EFFECT_PENALTY, CandidateFit
from soilml.gap.search.marginal_fits import MarginalFit
from soilml.gap.search.problem import FitProblem
from soilml.gap.statistics.signatures import Signature
from soilml.numerics.subspaces import ROUNDING, project_out


def predicted_with_and_without(
    problem: FitProblem, none: CandidateFit, soil: Solution, signatures: Sequence[Signature]
) -> dict[str, float]:
    """The larger of the gains predicted from the fit under a discrepancy, and under noise alone.

    A discrepancy of large amplitude can hide an effect that explains nearly everything.
    """
    plain = MarginalFit(soil, problem.discrepancy.evidence(soil, none.amplitude))
    with_discrepancy, without = (
        predicted_gains(problem, CandidateFit((), fit, fit), none.objective, signatures)
        for fit in (none.best, plain)
    )
    return {name: max(gain, without[name]) for name, gain in with_discrepancy.items()}


def predicted_gains(
    problem: FitProblem,
    candidate: CandidateFit,
    objective: float,
    signatures: Sequence[Signature],
) -> dict[str, float]:
    """Decrease of an objective by one more effect, linearised at a candidate, by effect name.

    An effect whose size would have an impossible sign gains nothing.
    """
    gains = {}
    for s in signatures:
        evidence = problem.discrepancy.evidence(
            candidate.fit, candidate.amplitude, s.column[:, None]
        )
        possible = s.sign == 0 or float(evidence.step[-1]) * s.sign > 0.0
        value = evidence.value + EFFECT_PENALTY * (len(candidate.names) + 1)
        gains[s.name] = objective - value if possible else -EFFECT_PENALTY
    return gains


def free_law_gains(
    problem: FitProblem, candidate: CandidateFit, fit: Solution, signatures: Sequence[Signature]
) -> dict[str, float]:
    """Decrease of a fit's sum of squares by each effect with free shapes, linearised.

    The discrepancy has the amplitudes of the candidate. The shapes have no prior, so that these
    are upper bounds, by which effects are selected whose law is not the catalogue's.
    """
    whiten = problem.discrepancy.whiten(candidate.amplitude)
    fit = fit.whitened_by(whiten)
    slip, load = problem.readings.log_slip_and_load
    gains = {}
    for s in signatures:
        columns = s.column[:, None] * np.column_stack([np.ones_like(slip), slip, load])
        projected = project_out(whiten @ columns, fit.jacobian)
        coefficient = np.linalg.lstsq(projected, fit.residual, rcond=ROUNDING)[0]
        possible = s.sign == 0 or coefficient[0] * s.sign > 0.0
        explained = float(np.sum((projected @ coefficient) ** 2))
        gains[s.name] = explained if possible else 0.0
    return gains


def noise_only_gains(
    problem: FitProblem, fit: Solution, signatures: Sequence[Signature]
) -> dict[str, float]:
    """Decrease of a fit's sum of squares by each effect under noise alone, linearised."""
    whiten = problem.covariance.whiten
    fit = fit.whitened_by(whiten)
    gains = {}
    for s in signatures:
        column = project_out((whiten @ s.column)[:, None], fit.jacobian)[:, 0]
        power = float(column @ column)
        moment = float(column @ fit.residual)
        possible = power > 0.0 and (s.sign == 0 or moment * s.sign > 0.0)
        gains[s.name] = moment**2 / power if possible else 0.0
    return gains
