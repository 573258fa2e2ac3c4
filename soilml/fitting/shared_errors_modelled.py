"""Errors of all rows as parameters beside those of the soil."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.free_parameters import FreeParameter
from soilml.fitting.observations import Observations
from soilml.fitting.shared_errors_effect import ModelledErrors
from soilml.numerics.prior import Prior

Floats = NDArray[np.float64]

#: Farthest from zero that an error is looked for, in standard deviations.
FARTHEST = 4.0


def with_modelled_errors(
    case: Case, data: Observations, free: Sequence[FreeParameter]
) -> tuple[Case, list[FreeParameter]]:
    """The case with errors that the model is solved with, and these behind the free parameters.

    Fractions of an error are linear in it, unlike those of a normal prior: readings are then nearly
    polynomials of them.
    """
    of_model = {f.name for f in fields(ModelledErrors)}
    errors = {name: std for name, std in data.shared_errors.items() if name in of_model}
    if not errors:
        return case, list(free)
    effect = ModelledErrors(typical_load=float(np.median(np.abs(data.load))))
    parameters = [
        FreeParameter(
            path=f"{effect.name}.{name}",
            unit="1",
            prior=Prior(-FARTHEST * std, FARTHEST * std),
            nominal=0.0,
            assumed=False,
            normal_std=std,
        )
        for name, std in errors.items()
    ]
    return replace(case, model=case.model + effect), [*free, *parameters]


def errors_at(free: Sequence[FreeParameter], u: Floats) -> Floats:
    """Errors (sets, e) in standard deviations, at fractions u (sets, p) of all parameters."""
    each = [f.prior.at(u[:, i]) / f.normal_std for i, f in enumerate(free) if f.normal_std]
    return np.stack(each, axis=1)
