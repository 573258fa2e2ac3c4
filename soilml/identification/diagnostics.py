"""What a user should know of a fit before believing it, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.identification.fit_result import Fit
from soilml.identification.free_parameters import FreeParameter
from soilml.identification.observations import Observations
from soilml.parameters import unit_text
from soilml.quantities import NOT_IDENTIFIED_ABOVE, WEAKLY_IDENTIFIED_ABOVE, column

#: Size r of a correlation from which on two parameters are reported as a trade-off: one combination
#: of the two, scaled to equal widths, is then known sqrt((1 + r) / (1 - r)) > 6 times better than
#: the other.
STRONG_CORRELATION = 0.95
#: Words by which a warning of residuals beyond the declared noise is recognised.
EXCESS_RESIDUALS = "times the declared noise"


def at_prior_bound(u: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which fractions of priors stand at one of their ends."""
    return np.asarray(np.minimum(u, 1.0 - u) < 1e-3)


def with_warnings(
    fit: Fit,
    case: Case,
    data: Observations,
    free: Sequence[FreeParameter],
    u: NDArray[np.float64],
    *,
    surplus: bool,
    undeclared: bool,
) -> Fit:
    """The same fit with its warnings."""
    one_load = float(np.ptp(data.load)) <= 0.02 * float(np.mean(data.load))
    said = []
    for i, f in enumerate(free):
        left = fit.left[f.path]
        if one_load and f.path == "cohesion" and left > WEAKLY_IDENTIFIED_ABOVE:
            said.append("one load only: cohesion is not identified")
        elif left > NOT_IDENTIFIED_ABOVE:
            said.append(f"{f.path} is not identified: the rows leave {left:.0%} of its prior")
        elif left > WEAKLY_IDENTIFIED_ABOVE:
            said.append(f"{f.path} is hardly identified: the rows leave {left:.0%} of its prior")
        if at_prior_bound(u)[i]:
            end = "lower" if u[i] < 0.5 else "upper"
            said.append(f"{f.path} stands at the {end} end of its prior: the prior holds it there")
        if f.assumed:
            ends = f"{f.prior.lower:g} to {f.prior.upper:g} {unit_text(f.unit)}".rstrip()
            said.append(f"{f.path} has no prior: {ends} is assumed")
    if one_load and "cohesion" in fit.names and fit.left["cohesion"] <= WEAKLY_IDENTIFIED_ABOVE:
        said.append("one load only: cohesion rests on the change with slip alone")
    if data.cells < len(free):
        count = "1 reading" if data.cells == 1 else f"{data.cells} readings"
        said.append(f"{count} for {len(free)} parameters: the prior decides the rest")
    said += _trade_offs(fit)
    if surplus:
        said.append(
            f"residuals are {np.sqrt(fit.misfit):.1f} {EXCESS_RESIDUALS}: the model lacks something "
            "or the noise is understated; std is widened by as much"
        )
    if undeclared:
        names = ", ".join(column(c.name) for c in data.channels if not c.declared)
        said.append(f"noise of {names} is not declared: estimated from the residuals")
    said += [f"{name} is not used: its noise is not declared in [noise]" for name in data.left_out]
    return replace(fit, warnings=(*fit.warnings, *said))


def _trade_offs(fit: Fit) -> list[str]:
    correlation = fit.correlation
    return [
        f"{a} and {b} trade off (correlation {correlation[i, j]:+.2f}): "
        "the rows fix a combination of them better than either"
        for i, a in enumerate(fit.names)
        for j, b in enumerate(fit.names)
        if i < j and abs(correlation[i, j]) > STRONG_CORRELATION
    ]
