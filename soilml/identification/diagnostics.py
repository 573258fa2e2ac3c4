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
from soilml.remarks import Remark

#: Size r of a correlation from which on two parameters are reported as a trade-off: one combination
#: of the two, scaled to equal widths, is then known sqrt((1 + r) / (1 - r)) > 6 times better than
#: the other.
STRONG_CORRELATION = 0.95
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
    remarks: list[Remark] = []
    for i, f in enumerate(free):
        remarks += _identifiability(f.path, fit.remaining_fraction[f.path], one_load)
        if at_prior_bound(u)[i]:
            bound = "lower" if u[i] < 0.5 else "upper"
            text = f"{f.path} is at the {bound} bound of its prior, which determines the estimate"
            remarks.append(Remark("at-prior-bound", text, (f.path,)))
        if f.assumed:
            ends = f"{f.prior.lower:g} to {f.prior.upper:g} {unit_text(f.unit)}".rstrip()
            text = f"{f.path} has no prior: {ends} is assumed"
            remarks.append(Remark("assumed-prior", text, (f.path,)))
    fraction = fit.remaining_fraction.get("cohesion", 1.0)
    if one_load and fraction <= WEAKLY_IDENTIFIED_ABOVE:
        text = "one load only: cohesion is determined by the change with slip alone"
        remarks.append(Remark("one-load", text, ("cohesion",)))
    if data.reading_count < len(free):
        count = "1 reading" if data.reading_count == 1 else f"{data.reading_count} readings"
        text = f"{count} for {len(free)} parameters: the prior determines the rest"
        remarks.append(Remark("few-readings", text))
    remarks += _trade_offs(fit)
    if excess_residuals:
        remarks.append(
            excess_residuals_remark(
                float(np.sqrt(fit.misfit)), case, "std is multiplied by this factor"
            )
        )
    if undeclared:
        names = tuple(column(c.name) for c in data.channels if not c.declared)
        text = (
            f"noise of {', '.join(names)} is not declared: estimated from the residuals; declare "
            f'it in [noise] as {names[0]} = "2 %" or in its unit'
        )
        remarks.append(Remark("undeclared-noise", text, names))
    for name in data.excluded_channels:
        text = f"{name} is not used: its noise is not declared in [noise]"
        remarks.append(Remark("unused-channel", text, (name,)))
    return replace(fit, warnings=(*fit.warnings, *remarks))


def excess_residuals_remark(factor: float, case: Case, consequence: str) -> Remark:
    """That residuals are `factor` times the declared noise, and what follows."""
    allowed = f"the declared noise{' and discrepancy' if case.discrepancy else ''}"
    text = f"residuals are {factor:.1f} times {allowed}: the model lacks an effect or the noise is "
    return Remark("excess-residuals", f"{text}understated; {consequence}")


def _identifiability(name: str, fraction: float, one_load: bool) -> list[Remark]:
    """That a parameter is not or weakly identified, by the remaining fraction of its prior."""
    if one_load and name == "cohesion" and fraction > WEAKLY_IDENTIFIED_ABOVE:
        text = "one load only: cohesion is not identified"
        return [Remark("not-identified", text, (name,))]
    if fraction > NOT_IDENTIFIED_ABOVE:
        text = f"{name} is not identified: {fraction:.0%} of the prior's width remains"
        return [Remark("not-identified", text, (name,))]
    if fraction > WEAKLY_IDENTIFIED_ABOVE:
        text = f"{name} is weakly identified: {fraction:.0%} of the prior's width remains"
        return [Remark("weakly-identified", text, (name,))]
    return []


def _trade_offs(fit: Fit) -> list[Remark]:
    correlation = fit.correlation
    return [
        Remark(
            "trade-off",
            f"{a} and {b} trade off (correlation {correlation[i, j]:+.2f}): a combination of the "
            "two is identified better than either",
            (a, b),
        )
        for i, a in enumerate(fit.names)
        for j, b in enumerate(fit.names)
        if i < j and abs(correlation[i, j]) > STRONG_CORRELATION
    ]
