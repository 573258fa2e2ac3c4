"""Readings that a case expects of an experimental design."""

from __future__ import annotations

import numpy as np

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.gap.data.stacked_readings import StackedReadings, positive_std
from soilml.identification.operating_points import operating_points
from soilml.io.table import Table
from soilml.quantities import CHANNELS, column
from soilml.row_status import Status


def planned_readings(case: Case, design: Table) -> StackedReadings:
    """The readings that a case expects of a design, in the channels with declared noise."""
    at = operating_points(design)
    force = case.model(case.soil, at)
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
    rows, channels = len(design), len(names)
    runs, number = np.unique(design["run"], return_inverse=True)
    return StackedReadings(
        at=at,
        run=number.astype(np.int64),
        runs=tuple(str(r) for r in runs),
        order=np.arange(rows),
        channels=tuple(names),
        row=np.tile(np.arange(rows), channels),
        channel=np.repeat(np.arange(channels), rows),
        reading=np.concatenate(readings),
        std=np.concatenate(stds),
        noise=tuple(case.noise.get(column(n)) for n in names),
    )
