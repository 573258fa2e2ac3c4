"""Soils of a prior, and simulated readings of a wheel on them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml import Case, Force, Operating, Table
from soilml.quantities import SHEAR

Floats = NDArray[np.float64]
#: Parameters of a soil, in order: of three values the last is missing, and is that of the case.
NAMES = (*SHEAR, "kphi")


def soils(case: Case, count: int, rng: np.random.Generator) -> Floats:
    """Soils sampled from the prior, (count, 4): `NAMES` in SI; (count, 3) where kphi is known."""
    return np.stack([case.prior[n].at(rng.random(count)) for n in NAMES if n in case.prior], axis=1)


def wheel_forces(case: Case, values: Floats, slip: Floats, load: Floats | float) -> Force:
    """Forces of a case's model on soils (..., 3 or 4) at slips and loads of shape (...)."""
    names = NAMES[: values.shape[-1]]
    changed = case.with_values({name: values[..., k] for k, name in enumerate(names)})
    return changed.model(changed.soil, Operating(slip=slip, load=load))


def add_torque_noise(case: Case, torque: Floats, rng: np.random.Generator) -> Floats:
    """Torque (N m) with the sensor noise of a case."""
    return torque + case.noise["torque_Nm"].std(torque) * rng.standard_normal(torque.shape)


def bounds(case: Case, count: int = 3) -> tuple[Floats, Floats]:
    """Lower and upper end of the prior of the first `count` parameters, (count,) each."""
    ends = [(case.prior[name].lower, case.prior[name].upper) for name in NAMES[:count]]
    lower, upper = np.asarray(ends).T
    return lower, upper


def table(slip: Floats, torque: Floats, load: Floats) -> Table:
    """Readings (r,) of one soil as a table for `identify`."""
    run = np.full(slip.shape, "sweep")
    return Table({"run": run, "slip": slip, "load_N": load, "torque_Nm": torque})


def three_loads() -> tuple[Floats, Floats]:
    """Slips and loads (N) of eighteen readings, six slips at each of three loads."""
    return np.repeat(np.linspace(0.2, 0.6, 6), 3), np.tile([25.0, 50.0, 100.0], 6)
