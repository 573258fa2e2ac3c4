"""Which parameters are to be found, and where they may lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.numerics.prior import Prior
from soilml.parameters import Parameter

#: Where the shear parameters of natural soils lie, for a user who gives no prior.
_USUAL = {
    "cohesion": Prior(0.0, 10000.0),
    "friction_angle": Prior(0.17, 0.96),
    "shear_modulus": Prior(0.001, 0.1, log=True),
    "n": Prior(0.3, 1.8),
}
#: Bounds this many times the value are too wide to search; the search then reaches so far.
DECADES, REACH = 100.0, 30.0


@dataclass(frozen=True)
class FreeParameter:
    """A parameter to be found: its path, its unit, its prior, and the value the case gives it."""

    path: str
    unit: str
    prior: Prior
    nominal: float
    assumed: bool


def select_free(case: Case, names: Sequence[str] | None) -> list[FreeParameter]:
    """The named parameters, or those with a prior; raises `InputError` for an unknown name."""
    known = case.parameters()
    wanted = list(case.prior) if names is None else list(dict.fromkeys(names))
    if not wanted:
        raise InputError(
            "nothing to identify: give [soil.prior] in the model file, or --free cohesion,..."
        )
    found = []
    for name in wanted:
        if name not in known:
            raise InputError(f"--free {name!r} is no parameter; there are: {', '.join(known)}")
        parameter, nominal = known[name]
        prior = case.prior.get(name) or _USUAL.get(name)
        if prior is None:
            prior = _wide(parameter, float(nominal))
        found.append(
            FreeParameter(name, parameter.unit, prior, float(nominal), name not in case.prior)
        )
    return found


def _wide(parameter: Parameter, nominal: float) -> Prior:
    """Where a parameter may lie of which nothing is said: its bounds, or within reach of its value.

    Bounds that span decades say nothing; thirty times to either side of the value is then taken.
    """
    if nominal > 0.0 and parameter.upper > DECADES * nominal:
        return Prior(max(nominal / REACH, parameter.lower), nominal * REACH, log=True)
    return Prior(parameter.lower, parameter.upper)
