"""Free parameters of an identification, and their priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError, did_you_mean
from soilml.numerics.prior import Prior
from soilml.parameters import Parameter
from soilml.physics.soils.soil_tests import deviation_rates, deviations

Floats = NDArray[np.float64]

#: Ranges of natural soils, for parameters without a prior.
_DEFAULT_PRIORS = {
    "cohesion": Prior(0.0, 10000.0),
    "friction_angle": Prior(0.17, 0.96),
    "shear_modulus": Prior(0.001, 0.1, log=True),
    "n": Prior(0.3, 1.8),
}
#: An upper bound beyond this multiple of the value is too wide to search, two decades; the prior is
#: then this factor to either side of the value, three decades in all.
WIDE_BOUND, ASSUMED_FACTOR = 100.0, 30.0


@dataclass(frozen=True)
class FreeParameter:
    """A free parameter of a case.

    Attributes
    ----------
    path
        As in `Case.parameters`: `cohesion`, `slip-sinkage.n1`.
    unit
        SI unit of its values.
    prior
        The case's prior, or the one that is assumed.
    nominal
        The value that the case gives it.
    assumed
        Whether the case has no prior for it.
    normal_std
        Standard deviation of a normal density about zero that is to be multiplied with that of the
        prior; None where there is none.
    """

    path: str
    unit: str
    prior: Prior
    nominal: float
    assumed: bool
    normal_std: float | None = None

    @property
    def fraction_precision(self) -> float:
        """Precision of the normal distribution, in fractions, that stands for prior and density."""
        if self.normal_std is None:
            return self.prior.fraction_precision
        return ((self.prior.upper - self.prior.lower) / self.normal_std) ** 2


def select_free(case: Case, names: Sequence[str] | None) -> list[FreeParameter]:
    """The named parameters, by default those with a prior; `InputError` for an unknown name."""
    known = case.parameters()
    paths = list(case.prior) if names is None else list(dict.fromkeys(names))
    if not paths:
        raise InputError(
            "nothing to identify: give [soil.prior] in the model file, or --free cohesion,..."
        )
    free = []
    for name in paths:
        if name not in known:
            raise InputError(
                f"--free {name!r}: no such parameter; {did_you_mean(name, known)}this model has: "
                f"{', '.join(known)}"
            )
        parameter, nominal = known[name]
        prior = case.prior.get(name) or _DEFAULT_PRIORS.get(name)
        if prior is None:
            prior = _wide_prior(parameter, float(nominal))
        free.append(
            FreeParameter(name, parameter.unit, prior, float(nominal), name not in case.prior)
        )
    return free


def values_at(free: Sequence[FreeParameter], u: Floats) -> tuple[Floats, Floats]:
    """Values (p,) at fractions u (p,) of the priors, and their derivatives by u (p,)."""
    each = [u[i : i + 1] for i in range(len(free))]
    values = [float(f.prior.at(x)[0]) for f, x in zip(free, each, strict=True)]
    rates = [float(f.prior.rate(x)[0]) for f, x in zip(free, each, strict=True)]
    return np.asarray(values), np.asarray(rates)


def soil_test_deviations(case: Case, free: Sequence[FreeParameter], u: Floats) -> Floats:
    """Deviations (sets, t) from the case's tests of the soil, at fractions u (sets, p)."""
    values = np.stack([f.prior.at(u[:, i]) for i, f in enumerate(free)], axis=1)
    return deviations(case.soil_tests, case.soil, [f.path for f in free], values)


def soil_test_rates(case: Case, free: Sequence[FreeParameter], u: Floats) -> Floats:
    """Derivatives (t, p) of `soil_test_deviations` by the fractions, at u (p,)."""
    values, rates = values_at(free, u)
    names = [f.path for f in free]
    return deviation_rates(case.soil_tests, case.soil, names, values) * rates


def _wide_prior(parameter: Parameter, nominal: float) -> Prior:
    """The parameter's bounds; about its value where they span too many decades."""
    if nominal > 0.0 and parameter.upper > WIDE_BOUND * nominal:
        lower = max(nominal / ASSUMED_FACTOR, parameter.lower)
        return Prior(lower, nominal * ASSUMED_FACTOR, log=True)
    return Prior(parameter.lower, parameter.upper)
