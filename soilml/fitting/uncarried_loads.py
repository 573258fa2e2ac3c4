"""Why no soil of the priors carries the loads of the rows."""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.fitting.predictions import forces
from soilml.physics.operating_point import Operating
from soilml.row_status import Status


def raise_uncarried(case: Case, at: Operating) -> NoReturn:
    """Raise `FitError`, with the reason that the soil of the case has at the rows `at` (n,).

    For fits in which no soil of the priors has an equilibrium at all rows.
    """
    missing = missing_peak(case, at)
    if missing:
        raise FitError(f"no soil in the prior has a stress profile in all rows: {missing}")
    raise FitError(
        "no parameters in the prior carry the measured loads: check load_N, kphi, n and [gear]"
    )


def missing_peak(case: Case, at: Operating) -> str:
    """The first of the rows `at` (n,) whose maximum stress is outside the contact; "" for none."""
    outside = np.flatnonzero(np.asarray(forces(case, at).status) == Status.NO_PEAK)
    if not outside.size:
        return ""
    slip = float(np.broadcast_to(at.slip, np.broadcast(at.slip, at.load).shape)[outside[0]])
    a0, a1 = float(case.soil.a0), float(case.soil.a1)
    return (
        f"a0 + a1 slip is {a0 + a1 * slip:.3g} at slip {slip:.3g}, and must be above 0 and below "
        "1; change a0 or a1 in [soil]"
    )
