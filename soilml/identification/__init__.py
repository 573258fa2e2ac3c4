"""Analytic identification: soil parameters from a table of measurements, without training.

Every method has one signature, `(case, measured, free) -> Fit`; a new method is one new file and
one line here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from soilml.case import Case
from soilml.errors import InputError
from soilml.identification.fit import Fit
from soilml.identification.free import Free, chosen
from soilml.identification.linear import linear
from soilml.identification.measured import Measured, measured_rows
from soilml.identification.newton import newton
from soilml.identification.nonlinear import nonlinear
from soilml.table import Table

Method = Callable[[Case, Measured, Sequence[Free]], Fit]

#: Identification method by the name that `--method` takes.
METHODS: dict[str, Method] = {
    "nonlinear": nonlinear,
    "linear": linear,
    "newton": newton,
}


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
    data = measured_rows(case, table)
    fit = METHODS[method](case, data, chosen(case, free))
    return replace(fit, warnings=(*fit.warnings, *data.notes))


__all__ = ["METHODS", "Fit", "Free", "Measured", "identify"]
