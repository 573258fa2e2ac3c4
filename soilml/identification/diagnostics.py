"""Warnings about a fit: parameters that are not identified, trade-offs, excess residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.free_parameters import FreeParameter
from soilml.fitting.levels import is_one_load
from soilml.fitting.observations import Observations
from soilml.identification.fit_result import Fit
from soilml.parameters import unit_text
from soilml.quantities import NOT_IDENTIFIED_ABOVE, WEAKLY_IDENTIFIED_ABOVE, column

#: Size r of a correlation from which on two parameters are reported as a trade-off: one combination
#: of the two, scaled to equal widths, is then known sqrt((1 + r) / (1 - r)) > 6 times better than
#: the other.
STRONG_CORRELATION = 0.95
#: Words by which a warning of residuals beyond the declared noise is recognised.
EXCESS_RESIDUALS = "times the declared noise"
#: Distance from a bound of the prior, as a fraction of it, at which a value counts as at the bound.
BOUND_TOLERANCE = 1e-3


def at_prior_bound(u: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether fractions of priors (p,) are at one of the bounds."""
    return np.asarray(np.minimum(u, 1.0 - u) < BOUND_TOLERANCE)


def with_warnings(
    fit: Fit,
    case: Case,
    data: Observations,
    free: Sequence[FreeParameter],
    u: NDArray[np.float64],
    *,
    excess_residuals: bool,
    undeclared: bool,
) -> Fit:
    """The same fit with its warnings; `u` (p,) are its values as fractions of the priors."""
    one_load = is_one_load(data.load)
    texts = []
    for i, f in enumerate(free):
        texts += _identifiability(f.path, fit.remaining_fraction[f.path], one_load)
        if at_prior_bound(u)[i]:
            bound = "lower" if u[i] < 0.5 else "upper"
            texts.append(
                f"{f.path} is at the {bound} bound of its prior: the prior determines the estimate"
            )
        if f.assumed:
            ends = f"{f.prior.lower:g} to {f.prior.upper:g} {unit_text(f.unit)}".rstrip()
            texts.append(f"{f.path} has no prior: {ends} is assumed")
    fraction = fit.remaining_fraction.get("cohesion", 1.0)
    if one_load and fraction <= WEAKLY_IDENTIFIED_ABOVE:
        texts.append("one load only: cohesion is determined by the change with slip alone")
    if data.reading_count < len(free):
        count = "1 reading" if data.reading_count == 1 else f"{data.reading_count} readings"
        texts.append(f"{count} for {len(free)} parameters: the prior determines the rest")
    texts += _trade_offs(fit)
    if excess_residuals:
        allowed = f"{EXCESS_RESIDUALS}{' and discrepancy' if case.discrepancy else ''}"
        texts.append(
            f"residuals are {np.sqrt(fit.misfit):.1f} {allowed}: the model lacks an effect or "
            "the noise is understated; std is multiplied by this factor"
        )
    if undeclared:
        names = ", ".join(column(c.name) for c in data.channels if not c.declared)
        texts.append(
            f"noise of {names} is not declared: estimated from the residuals; declare it in "
            f'[noise] as {names.split(", ")[0]} = "2 %" or in its unit'
        )
    texts += [
        f"{name} is not used: its noise is not declared in [noise]"
        for name in data.excluded_channels
    ]
    return replace(fit, warnings=(*fit.warnings, *texts))


def _identifiability(name: str, fraction: float, one_load: bool) -> list[str]:
    """That a parameter is not or weakly identified, by the remaining fraction of its prior."""
    if one_load and name == "cohesion" and fraction > WEAKLY_IDENTIFIED_ABOVE:
        return ["one load only: cohesion is not identified"]
    if fraction > NOT_IDENTIFIED_ABOVE:
        return [f"{name} is not identified: {fraction:.0%} of the prior's width remains"]
    if fraction > WEAKLY_IDENTIFIED_ABOVE:
        return [f"{name} is weakly identified: {fraction:.0%} of the prior's width remains"]
    return []


def _trade_offs(fit: Fit) -> list[str]:
    correlation = fit.correlation
    return [
        f"{a} and {b} trade off (correlation {correlation[i, j]:+.2f}): a combination of the two "
        "is identified better than either"
        for i, a in enumerate(fit.names)
        for j, b in enumerate(fit.names)
        if i < j and abs(correlation[i, j]) > STRONG_CORRELATION
    ]
