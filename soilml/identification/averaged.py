"""The soil by the one posterior over what a model may lack: the default answer of `identify`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.candidate_effects import candidate_effects
from soilml.fitting.coordinates import Coordinate, values_at
from soilml.fitting.error_columns import shared_columns
from soilml.fitting.global_optimum import raise_uncarried
from soilml.fitting.misfit import Misfit, fit_under_declared_noise
from soilml.fitting.readings import Readings
from soilml.identification.fit import Fit, SoilExplanation
from soilml.identification.posterior import (
    PosteriorSamples,
    check_declared,
    fit_of_samples,
    posterior,
    posterior_samples,
)
from soilml.inference import constants
from soilml.inference.draws import Draws
from soilml.inference.posterior import infer
from soilml.inference.problem import InferenceProblem
from soilml.numerics.importance_sampling import ImportanceSample
from soilml.physics.effects import EFFECTS
from soilml.remarks import Remark


def averaged(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Fit:
    r"""Mean, covariance and 90 % interval of the soil over all explanations of the rows.

    .. math::
        p(\theta | y) = \sum_h p(h | y) \int p(\theta | y, h, \eta)\, p(\eta | y, h)\, d\eta

    over the hypotheses h on what the model lacks and the hyperparameters of its Gaussian terms; see
    `soilml.inference`. Soils outside of the priors of the case have no weight. A case that states
    the error of its model in [discrepancy] or [remainder] has one explanation, itself: the result
    is that of the exact posterior.

    Parameters
    ----------
    case
        Model, soil, priors and noise.
    readings
        Rows; noise that is not declared is that of the residuals of the soil alone.
    free
        The p free parameters.

    Returns
    -------
    Fit
        With `explanations`.

    Raises
    ------
    FitError
        Where no parameters in the prior carry the measured loads.
    """
    if case.states_model_error:
        return posterior(case, readings, free)
    found = averaged_samples(case, readings, free)
    consequence = "the interval averages over what the model may lack" if found.rejected else ""
    fit = fit_of_samples("averaged", found, case, readings, free, consequence)
    if sum(one.probability for one in found.explanations if one.exact) < constants.UNLIKELY_MODEL:
        text = "other explanations are a hundred times as likely as the model as in its file"
        fit = replace(fit, warnings=(Remark("unlikely", text), *fit.warnings))
    return fit


def averaged_samples(
    case: Case, readings: Readings, free: Sequence[Coordinate]
) -> PosteriorSamples:
    """Weighted samples of the soil over all explanations of the rows; see `averaged`."""
    optimum = fit_under_declared_noise(case, readings, free)
    misfit = Misfit.of(optimum)
    if readings.undeclared:
        std, unknown = optimum.problem.readings.std, ~np.isfinite(readings.std)
        names = [readings.channels[i] for i in readings.channel[unknown]]
        readings = readings.with_default_std(dict(zip(names, std[unknown], strict=True)))
    problem = InferenceProblem.of(case, readings, free, candidate_effects(case, EFFECTS))
    try:
        found = infer(problem)
    except InputError:
        raise_uncarried(case, readings.at)
    if found.refused is not None:
        raise_uncarried(case, readings.at)
    rejected = misfit.exceeds_noise and not found.scatters
    fixed, inner = shared_columns(found.soil.fit.fitted(), found.terms.readings, free)
    found = found.beside(fixed, inner)
    u, weights = map(
        np.concatenate, zip(*(_fractions(d, free) for d in found.draws(0)), strict=True)
    )
    weights = weights if weights.sum() > 0.0 else np.ones_like(weights)
    sample = ImportanceSample(u, weights / weights.sum(), 0.0)
    shares: dict[tuple[tuple[str, ...], bool], float] = {}
    for one in found.components():
        key = one.node.hypothesis.effects, one.at.present
        shares[key] = shares.get(key, 0.0) + one.weight
    stated = (SoilExplanation(*key, share) for key, share in shares.items())
    explained = tuple(sorted(stated, key=lambda one: -one.probability))
    return PosteriorSamples(sample, misfit.per_freedom, rejected, explanations=explained)


def soil_samples(
    case: Case, readings: Readings, free: Sequence[Coordinate], exact_model: bool = False
) -> PosteriorSamples:
    """Samples of the soil over all explanations of the rows, as `averaged` takes them.

    With `exact_model`, and where the case states the error of its model, those of the exact
    posterior. Raises `FitError` as `averaged`, and where noise is not declared.
    """
    check_declared(readings)
    if exact_model or case.states_model_error:
        return posterior_samples(case, readings, free)
    return averaged_samples(case, readings, free)


def _fractions(own: Draws, free: Sequence[Coordinate]) -> tuple[Floats, Floats]:
    """Draws as fractions (k, p) of the priors, and weights (k,): none outside of these priors."""
    paths = [c.path for c in own.node.fit.coordinates]
    at = [paths.index(c.path) for c in free]
    if not own.node.hypothesis.wide_priors:
        return own.x[:, at], own.weight
    values = values_at([own.node.fit.coordinates[i] for i in at], own.x[:, at])
    u = np.asarray(
        [[c.prior.fraction(float(v)) for c, v in zip(free, x, strict=True)] for x in values]
    )
    inside = ((u > 0.0) & (u < 1.0)).all(axis=1)
    return u, own.weight * inside
