"""Propagation of the prior of a parameter that a method needs fixed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification.fit import Fit
from soilml.remarks import Remark

#: One standard deviation of a uniform prior to either side of its middle, as fractions of it.
SIDES = (0.5 - 12.0**-0.5, 0.5 + 12.0**-0.5)
#: Misfit, residuals of twice the declared noise, above which a closed form does not apply.
MOST_MISFIT = 4.0


def with_fixed_parameter(case: Case, path: str, solve: Callable[[Case], Fit]) -> Fit:
    """Solve with the parameter `path` fixed at the case's value, and propagate its prior.

    The covariance grows by the mean square change of the solution when the fixed value is moved one
    standard deviation to either side of the prior's middle. Without a prior the value is taken as
    exact.
    """
    fit = solve(case)
    prior = case.prior.get(path)
    value = float(case.parameters()[path][1])
    if prior is None:
        text = f"{path} is fixed at {value:g} and treated as exact: it has no prior"
        note = Remark("fixed-parameter", text, (path,))
        return replace(fit, warnings=(note, *fit.warnings, *_validity(fit, case)))
    covariance = fit.covariance.copy()
    for side in SIDES:
        moved = float(prior.at(np.asarray([side]))[0])
        try:
            change = solve(case.with_values({path: moved})).values - fit.values
        except FitError:
            continue
        covariance += 0.5 * np.outer(change, change)
    text = f"{path} is fixed at {value:g}; the width of its prior is propagated into std"
    note = Remark("fixed-parameter", text, (path,))
    warnings = (note, *fit.warnings, *_validity(fit, case))
    return replace(fit, covariance=covariance, warnings=warnings)


def _validity(fit: Fit, case: Case) -> list[Remark]:
    """Values outside their priors and residuals beyond the noise: the method has no bounds."""
    remarks = []
    for name, value in zip(fit.names, fit.values, strict=True):
        prior = case.prior.get(name)
        if prior is not None and not prior.lower <= value <= prior.upper:
            ends = f"{prior.lower:g} to {prior.upper:g}"
            text = f"{name} is {value:.4g}, outside its prior of {ends}: do not use it"
            remarks.append(Remark("outside-prior", text, (name,)))
    if fit.misfit > MOST_MISFIT:
        text = (
            f"residuals are {np.sqrt(fit.misfit):.1f} times the declared noise: the closed form "
            "does not describe these rows; use --method nonlinear"
        )
        remarks.append(Remark("excess-residuals", text))
    return remarks
