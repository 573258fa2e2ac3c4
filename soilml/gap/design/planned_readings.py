"""Readings that a case expects of an experimental design, or of a run that could be driven."""

from __future__ import annotations

from dataclasses import replace

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
USUAL_COVARIATES = {"speed": 0.05, "pass_number": 1.0, "slip_angle": 0.0, **AFTER_CAMPAIGN}


def planned_readings(case: Case, design: Table) -> Readings:
    """The readings that a case expects of a design, in the channels with declared noise."""
    design = with_rover_columns(case, design)
    check_wheel_size(case, design)
    at = operating_points(design)
    force = forces(case, at)
    if np.any(force.status != 0):
        row = int(np.flatnonzero(force.status)[0])
        raise InputError(f"{design.place(row)}: {Status(int(force.status[row])).reason}")
    names, readings, stds = [], [], []
    for name in CHANNELS:
        expected = np.asarray(getattr(force, name))
        filled = Table({**design.columns, column(name): expected}, design.source, design.line)
        std = positive_std(case, filled, column(name))
        if np.isfinite(std).all():
            names.append(name)
            readings.append(expected)
            stds.append(std)
    if not names:
        raise InputError("no channel has declared noise: give [noise] in the model file")
    runs, number = np.unique(design["run"], return_inverse=True)
    return Readings.of_every_row(
        at,
        names,
        measured=np.concatenate(readings),
        std=np.concatenate(stds),
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
    for i, (name, own) in enumerate(
        zip(like.channels, np.split(measured, len(like.channels)), strict=True)
    ):
        noise = like.noise[i] or case.noise.get(column(name))
        present = like.std[like.channel == i]
        typical = float(np.median(present)) if present.size else np.nan
        std = np.full(own.shape, typical) if noise is None else noise.std(own)
        stds.append(np.maximum(std, 1e-12))
    return Readings.of_every_row(
        with_default_covariates(at, case),
        like.channels,
        measured=measured,
        std=np.concatenate(stds),
        noise=like.noise,
        runs=(run,),
    )


def joined_readings(first: Readings, second: Readings) -> Readings:
    """The readings of two sets of rows together; covariates that one of them lacks are usual."""
    sizes = len(first.run), len(second.run)

    def rows(name: str) -> Floats:
        values = [getattr(part.at, name) for part in (first, second)]
        known = [USUAL_COVARIATES[name] if value is None else value for value in values]
        return np.concatenate([np.broadcast_to(v, n) for v, n in zip(known, sizes, strict=True)])

    given = {
        k for k in USUAL_COVARIATES for part in (first, second) if getattr(part.at, k) is not None
    }
    at = Operating(slip=rows("slip"), load=rows("load"), **{name: rows(name) for name in given})
    return replace(
        first,
        at=replace(at, gear=_joined_gears(first, second)),
        run=np.concatenate([first.run, second.run + len(first.runs)]),
        runs=(*first.runs, *second.runs),
        order=np.concatenate([first.order, second.order]),
        row=np.concatenate([first.row, second.row + sizes[0]]),
        channel=np.concatenate([first.channel, second.channel]),
        measured=np.concatenate([first.measured, second.measured]),
        std=np.concatenate([first.std, second.std]),
        from_case=np.concatenate([first.from_case, second.from_case]),
        slip_std=np.concatenate([first.slip_std, second.slip_std]),
        load_std=np.concatenate([first.load_std, second.load_std]),
        sensor_std=None,
    )


def _joined_gears(first: Readings, second: Readings) -> NDArray[np.str_] | None:
    """The gears of two sets of rows together; None where both name none."""
    if first.at.gear is None and second.at.gear is None:
        return None
    gears = (UNNAMED_GEAR if part.at.gear is None else part.at.gear for part in (first, second))
    counts = (len(first.run), len(second.run))
    return np.concatenate([np.broadcast_to(g, n) for g, n in zip(gears, counts, strict=True)])


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
