"""The case with the fitted soil and effects."""

from __future__ import annotations

from dataclasses import replace

from soilml.config.case import Case
from soilml.config.model_discrepancy import Discrepancy
from soilml.fitting.coordinates import EffectCoordinate
from soilml.fitting.least_squares import Solution
from soilml.numerics.prior import Prior
from soilml.numerics.rounding import significant

#: Half width of the prior of an effect's size, in standard deviations.
PRIOR_HALF_WIDTH = 3.0


def updated_case(fit: Solution, discrepancy: dict[str, float] | None = None) -> Case:
    """The fitted case: soil and effects at their optimum, with the priors and noise of the input.

    Values are rounded to significant digits.

    The size of each effect gets a uniform prior of three standard deviations to either side, so
    that its uncertainty is propagated where the model is used. `discrepancy` holds the standard
    deviations of the smooth discrepancy by column, in the column's unit; None keeps what the case
    declares.
    """
    values, stds = {path: significant(v) for path, v in fit.values().items()}, fit.stds()
    case = fit.case.with_values(values)
    prior = dict(fit.case.prior)
    bounds = {path: parameter for path, (parameter, _) in case.parameters().items()}
    for c in fit.coordinates:
        if not isinstance(c, EffectCoordinate) or c.is_shape:
            continue
        value, reach = values[c.path], PRIOR_HALF_WIDTH * stds[c.path]
        lower = max(bounds[c.path].lower, significant(value - reach))
        upper = min(bounds[c.path].upper, significant(value + reach))
        if lower < upper:
            prior[c.path] = Prior(lower, upper)
    remaining = dict(fit.case.discrepancy)
    if discrepancy is not None:
        declared = next(iter(remaining.values()), Discrepancy())
        remaining = {
            name: replace(declared, share=0.0, constant=significant(std))
            for name, std in discrepancy.items()
        }
    return replace(case, prior=prior, noise=dict(fit.case.noise), discrepancy=remaining)
