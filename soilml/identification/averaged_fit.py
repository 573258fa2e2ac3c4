"""The fit averaged over explanations, and the one that takes the model as exact beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.readings import Readings
from soilml.identification.averaged import averaged_samples
from soilml.identification.fit import Fit, with_warnings
from soilml.identification.nonlinear import nonlinear
from soilml.identification.posterior import (
    PosteriorSamples,
    fit_of_samples,
    posterior,
    posterior_samples,
)
from soilml.identification.posterior_density import check_declared
from soilml.remarks import Remark


def averaged(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Fit:
    """Mean, covariance and 90 % interval of the soil over all explanations of the rows.

    See `soilml.identification.averaged.averaged_samples`. A case that states the error of its model
    in [discrepancy] or [remainder] has one explanation, itself: the result is that of the exact
    posterior. So it is, with a remark, where the explanations cannot be fitted.

    Parameters
    ----------
    case
        Model, soil, priors and noise.
    readings
        Rows; noise that is not declared is estimated from residuals.
    free
        The p free parameters.

    Returns
    -------
    Fit
        With `explanations` and `exact_model`.

    Raises
    ------
    FitError
        Where no parameters in the prior carry the measured loads.
    """
    exact = _exact(case, readings, free)
    if case.states_model_error:
        return exact
    try:
        found = averaged_samples(case, readings, free)
    except FitError as error:
        text = f"the model is taken as exact, since no other explanation can be fitted: {error}"
        return replace(exact, warnings=(Remark("not-averaged", text), *exact.warnings))
    fit, mean_u = fit_of_samples("averaged", found, readings, free)
    fit = with_warnings(
        fit,
        case,
        readings,
        free,
        mean_u,
        excess_residuals=False,
        undeclared=bool(readings.undeclared),
    )
    if found.noise_inflated:
        excess = beyond_all_explanations(found.noise_scale, "std is multiplied by this factor")
        fit = replace(fit, warnings=(*fit.warnings, excess))
    if not any(one.exact for one in found.explanations):
        text = "other explanations are a hundred times as likely as the model taken as exact"
        exact = replace(exact, warnings=(*exact.warnings, Remark("unlikely", text)))
    return replace(fit, explanations=found.explanations, exact_model=replace(exact, samples=None))


def beyond_all_explanations(factor: float, consequence: str) -> Remark:
    """That residuals are `factor` times what any explanation leaves, and what follows."""
    text = (
        f"residuals are {factor:.1f} times what noise, typical errors and effects of the catalogue "
        f"explain: run soilml gap; {consequence}"
    )
    return Remark("excess-residuals", text)


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


def _exact(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Fit:
    """The exact posterior; least squares, said so, where it cannot be sampled."""
    if readings.undeclared:
        return nonlinear(case, readings, free)
    try:
        return posterior(case, readings, free)
    except FitError as error:
        text = f"exact_model is a fit by least squares, since its posterior failed: {error}"
        fit = nonlinear(case, readings, free)
        return replace(fit, warnings=(Remark("fell-back", text), *fit.warnings))
