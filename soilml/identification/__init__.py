"""Analytic identification: soil parameters from a table of measurements, without training.

Every method has one signature, `(case, measured, free) -> Fit`; a new method is one new file and
one line here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.identification.fit_result import Fit
from soilml.identification.free_parameters import FreeParameter, select_free
from soilml.identification.linear import linear
from soilml.identification.newton import newton
from soilml.identification.nonlinear import nonlinear
from soilml.identification.observations import Observations, read_observations
from soilml.identification.posterior import posterior
from soilml.io.table import Table
from soilml.physics.gears.rigid_wheel import RigidWheel

Method = Callable[[Case, Observations, Sequence[FreeParameter]], Fit]

#: Identification method by the name that `--method` takes.
METHODS: dict[str, Method] = {
    "nonlinear": nonlinear,
    "linear": linear,
    "newton": newton,
    "posterior": posterior,
}
#: Those that rest on the closed form of a rigid wheel's linear stresses.
CLOSED_FORM = ("linear", "newton")


def identify(
    case: Case, table: Table, free: Sequence[str] | None = None, method: str = "nonlinear"
) -> Fit:
    """Soil parameters of a case from measured rows.

    `free` names parameters (`cohesion`, `kphi`, `slip-sinkage.n1`); without it, those that have a
    prior are freed. Raises `InputError` for names that do not exist, `FitError` where the rows
    cannot be fitted as asked.
    """
    if method not in METHODS:
        raise InputError(f"no method {method!r}; there are: {', '.join(METHODS)}")
    if method in CLOSED_FORM and not isinstance(case.model.gear, RigidWheel):
        raise InputError(
            f"the {method} method has its equations for rigid wheels alone, not for "
            f"{case.model.gear.name}; take nonlinear"
        )
    data = read_observations(case, table)
    fit = METHODS[method](case, data, select_free(case, free))
    return replace(fit, warnings=(*fit.warnings, *_not_followed(fit, data, free), *data.notes))


def _not_followed(fit: Fit, data: Observations, free: Sequence[str] | None) -> list[str]:
    """What was asked for and a method of fixed unknowns did not do."""
    said = []
    if free is not None and (others := [name for name in fit.names if name not in free]):
        said.append(
            f"{', '.join(others)} found too, though not asked for: the {fit.method} method finds "
            f"{', '.join(fit.names)} together"
        )
    if fit.method in CLOSED_FORM and (np.any(data.slip_std) or np.any(data.load_std)):
        said.append(f"the {fit.method} method does not carry noise of slip and load into std")
    return said


__all__ = ["METHODS", "Fit", "FreeParameter", "Observations", "identify"]
