"""What a value that a method takes as given does to its answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification.fit_result import Fit

#: One standard deviation of a uniform prior to either side of its middle, as fractions of it.
SIDES = (0.5 - 12.0**-0.5, 0.5 + 12.0**-0.5)


def with_fixed_parameters(case: Case, path: str, solve: Callable[[Case], Fit]) -> Fit:
    """Solve with the parameter `path` as the case has it, and widen by what its prior leaves open.

    The covariance grows by the mean square change of the answer when the given value is moved to
    either side of its prior; where there is no prior, the value is believed.
    """
    fit = solve(case)
    prior = case.prior.get(path)
    value = float(case.parameters()[path][1])
    if prior is None:
        said = f"{path} is taken as given, and believed: {value:g}"
        return replace(fit, warnings=(said, *fit.warnings, *_outside(fit, case)))
    covariance = fit.covariance.copy()
    for side in SIDES:
        moved = float(prior.at(np.asarray([side]))[0])
        try:
            change = solve(case.with_values({path: moved})).values - fit.values
        except FitError:
            continue
        covariance += 0.5 * np.outer(change, change)
    said = f"{path} is taken as given: {value:g}; the width of its prior is carried into std"
    warnings = (said, *fit.warnings, *_outside(fit, case))
    return replace(fit, covariance=covariance, warnings=warnings)


def _outside(fit: Fit, case: Case) -> list[str]:
    """What in an answer of a method without bounds cannot be believed."""
    said = []
    for name, value in zip(fit.names, fit.values, strict=True):
        prior = case.prior.get(name)
        if prior is not None and not prior.lower <= value <= prior.upper:
            said.append(
                f"{name} is {value:.4g}, outside its prior of {prior.lower:g} to {prior.upper:g}: "
                "do not use it"
            )
    if fit.misfit > 4.0:
        said.append(
            f"residuals are {np.sqrt(fit.misfit):.1f} times the declared noise: the closed form "
            "does not describe these rows; use --method nonlinear"
        )
    return said
