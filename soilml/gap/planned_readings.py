"""Readings that a case expects of an experimental design, or of a run that could be driven."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.compatibility import check_wheel_size
from soilml.config.model_settings import UNNAMED_GEAR
from soilml.errors import InputError
from soilml.fitting.operating_points import operating_points, with_rover_columns
from soilml.fitting.predictions import forces
from soilml.fitting.readings import Readings, positive_std
from soilml.io.table import Table
from soilml.physics.operating_point import AFTER_CAMPAIGN, Operating
from soilml.quantities import CHANNELS, column
from soilml.row_status import Status

#: Covariates of a plain run, where nothing else is known: a slow wheel on virgin soil, straight on,
#: after the campaign, with a load cell that does not lag.
USUAL_COVARIATES: dict[str, Any] = {
    "speed": 0.05,
    "pass_number": 1.0,
    "slip_angle": 0.0,
    **AFTER_CAMPAIGN,
}


def planned_readings(case: Case, design: Table) -> Readings:
    """The readings that a case expects of a design, in the channels with declared noise."""
    design = with_rover_columns(case, design)
    check_wheel_size(case, design)
    at = operating_points(design)
    force = forces(case, at)
    if np.any(force.status != 0):
        row = int(np.flatnonzero(force.status)[0])
        raise InputError(f"{design.place(row)}: {Status(int(force.status[row])).reason}")
    expected = {column(name): np.asarray(getattr(force, name)) for name in CHANNELS}
    filled = replace(design, columns={**design.columns, **expected})
    stds = {name: positive_std(case, filled, column(name)) for name in CHANNELS}
    names = [name for name, std in stds.items() if np.isfinite(std).all()]
    if not names:
        raise InputError("no channel has declared noise: give [noise] in the model file")
    runs, number = np.unique(design["run"], return_inverse=True)
    return Readings.of_every_row(
        at,
        names,
        measured=np.concatenate([expected[column(n)] for n in names]),
        std=np.concatenate([stds[n] for n in names]),
        noise=[case.noise.get(column(n)) for n in names],
        run=number.astype(np.int64),
        runs=[str(r) for r in runs],
    )


def expected_readings(at: Operating, like: Readings, case: Case, run: str = "next") -> Readings:
    """The readings that a case expects of rows, in the channels and with the noise of `like`."""
    force = forces(case, with_default_covariates(at, case))
    measured = np.concatenate([np.asarray(getattr(force, name)) for name in like.channels])
    return readings_like(at, like, case, measured, run)


def readings_like(
    at: Operating, like: Readings, case: Case, measured: Floats, run: str
) -> Readings:
    """Measured values (m,) of rows, in the channels and with the noise of `like`."""
    stds = []
    for i, own in enumerate(np.split(measured, len(like.channels))):
        noise = like.noise[i] or case.noise.get(column(like.channels[i]))
        typical = np.full(own.shape, np.median(like.std[like.channel == i]))
        stds.append(np.maximum(typical if noise is None else noise.std(own), 1e-12))
    return Readings.of_every_row(
        with_default_covariates(at, case),
        like.channels,
        measured=measured,
        std=np.concatenate(stds),
        noise=like.noise,
        runs=(run,),
    )


def joined_readings(first: Readings, second: Readings) -> Readings:
    """Planned readings of two sets of rows; covariates that one of them lacks are usual."""
    sizes, channels = (len(first.run), len(second.run)), len(first.channels)
    usual = USUAL_COVARIATES | {"gear": UNNAMED_GEAR}
    known = [k for k in usual if not getattr(first.at, k) is getattr(second.at, k) is None]

    def rows(name: str) -> NDArray[Any]:
        given = (getattr(part.at, name) for part in (first, second))
        values = [usual[name] if value is None else value for value in given]
        return np.concatenate([np.broadcast_to(v, n) for v, n in zip(values, sizes, strict=True)])

    def readings(name: str) -> Floats:
        parts = (np.split(getattr(part, name), channels) for part in (first, second))
        return np.concatenate([own for pair in zip(*parts, strict=True) for own in pair])

    return Readings.of_every_row(
        Operating(**{name: rows(name) for name in ("slip", "load", *known)}),
        first.channels,
        measured=readings("measured"),
        std=readings("std"),
        noise=first.noise,
        run=np.concatenate([first.run, second.run + len(first.runs)]),
        runs=(*first.runs, *second.runs),
    )


def carried_rows(case: Case, at: Operating) -> NDArray[np.bool_]:
    """Rows (n,) at which the model finds an equilibrium: the soil carries the load."""
    status = forces(case, with_default_covariates(at, case)).status
    return np.broadcast_to(np.asarray(status) == 0, np.shape(at.slip))


def with_default_covariates(at: Operating, case: Case) -> Operating:
    """The operating points with default values of covariates that the case's effects need."""
    models = (case.model, *case.gears.values())
    needs = {field for m in models for effect in m.effects for field in effect.about.needs}
    missing = {f: USUAL_COVARIATES[f] for f in needs if getattr(at, f) is None}
    return replace(at, **missing) if missing else at
