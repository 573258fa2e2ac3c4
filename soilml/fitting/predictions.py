"""What a case predicts for readings, and how that changes with the coordinates of a fit.

`predict` and `linearise` solve all sets of coordinates in one call of the physics, for each gear by
itself, and take the readings from its forces, with the mean of the remainder.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.mixtures import mixed_forces
from soilml.fitting.operating_points import rows_by_gear
from soilml.fitting.readings import Readings
from soilml.parameters import check_number, located, mapped
from soilml.physics.contact import Force, Resolution
from soilml.physics.equilibrium import sensor_readings
from soilml.physics.linear_response import linear_response
from soilml.physics.load_case import LoadCase
from soilml.physics.model import in_chunks_near
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.physics.sinkage_estimate import SinkageEstimate
from soilml.quantities import CHANNELS

#: Step of the difference quotients, in units of the coordinate: rounding errors of a reading at
#: given sinkage (1e-14 of it) and curvature then both stay below 1e-5 of a derivative.
DIFFERENCE_STEP = 1e-6


@dataclass(frozen=True)
class Linearisation:
    """Predictions of m readings at coordinates x (p,), and their first-order changes."""

    x: Floats  # (p,)
    prediction: Floats  # (m,)
    jacobian: Floats  # (m, p)
    log_sinkage: Floats  # (n,) logarithm of the sinkage in m
    log_sinkage_rate: Floats  # (p, n)
    slope: Floats  # (n,), d ln W / d ln z

    def sinkage_at(self, x: Floats) -> SinkageEstimate:
        """Sinkage (sets, n) at coordinates x (sets, p)."""
        log_sinkage = self.log_sinkage + (x - self.x) @ self.log_sinkage_rate
        return SinkageEstimate(log_sinkage, np.broadcast_to(self.slope, log_sinkage.shape))


def predict(
    case: Case,
    coordinates: Sequence[Coordinate],
    x: Floats,
    readings: Readings,
    start: SinkageEstimate | None = None,
) -> Floats:
    """Predictions (sets, m) at coordinates `x` (sets, p); NaN where there is no equilibrium.

    start: Sinkage (sets, n) at which the searches for equilibrium start.

    Raises `InputError` where the model refuses a value.
    """
    if not case.gears:
        load_case = _load_case(case, coordinates, x, readings.at)
        with np.errstate(all="ignore"):  # rows without an answer are flagged, not warned about
            force = in_chunks_near(load_case, sensor_readings, _raveled(start))
        return _stacked(case, readings, force)
    y = np.full((len(x), len(readings)), np.nan)
    for of_gear, free, part, kept, rows, chosen in _readings_by_gear(case, coordinates, readings):
        y[:, chosen] = predict(of_gear, free, x[:, kept], part, _of_rows(start, rows))
    return y


def linearise(
    case: Case,
    coordinates: Sequence[Coordinate],
    x: Floats,
    readings: Readings,
    near: Linearisation | None = None,
) -> Linearisation:
    """Predictions at coordinates `x` (p,) and their derivatives.

    One-sided differences at the sinkage of the equilibrium at x; see
    `soilml.physics.linear_response`. The step points downwards for a coordinate at its upper
    bound. A reading without equilibrium is NaN, and so are its derivatives.

    near: A linearisation of the same coordinates near x, from which the search for equilibrium
        starts.

    Raises `InputError` where the model refuses a value.
    """
    start = None if near is None else near.sinkage_at(x[None, :])
    if not case.gears:
        return _linearised(case, coordinates, x, readings, start)
    m, n, p = len(readings), len(readings.run), len(coordinates)
    joined = Linearisation(
        x, np.full(m, np.nan), np.zeros((m, p)), np.full(n, np.nan), np.zeros((p, n)),
        np.full(n, np.nan),
    )  # fmt: skip
    for of_gear, free, part, kept, rows, chosen in _readings_by_gear(case, coordinates, readings):
        own = _linearised(of_gear, free, x[kept], part, _of_rows(start, rows))
        joined.prediction[chosen] = own.prediction
        joined.jacobian[np.ix_(chosen, kept)] = own.jacobian
        joined.log_sinkage[rows] = own.log_sinkage
        joined.log_sinkage_rate[np.ix_(kept, rows)] = own.log_sinkage_rate
        joined.slope[rows] = own.slope
    return joined


def predict_channels(
    case: Case, coordinates: Sequence[Coordinate], x: Floats, at: Operating
) -> dict[str, Floats]:
    """Each channel (sets, n) at operating points (n,), at coordinates `x` (sets, p)."""
    y = predict(case, coordinates, x, Readings.of_every_row(at))
    parts = np.split(y, len(CHANNELS), axis=1)
    return dict(zip(CHANNELS, parts, strict=True))


def forces(case: Case, at: Operating) -> Force:
    """Forces (n,) of a case, with its remainder, at points (n,) that several gears may drive."""
    if not case.gears:
        return forces_of_one_gear(case, at)
    count = np.broadcast(at.slip, at.load).size
    joined: dict[str, Any] = {
        f.name: np.zeros(count, np.int64 if f.name == "status" else np.float64)
        for f in fields(Force)
    }
    for part in rows_by_gear(case, at):
        force = forces_of_one_gear(part.case, part.at)
        for name, values in joined.items():
            values[part.rows] = getattr(force, name)
    return Force(**joined)


def forces_of_one_gear(case: Case, at: Operating) -> Force:
    """Forces of a case of one gear with its remainder; of several explanations, their mean."""
    if case.explanations:
        return mixed_forces(case, lambda one: forces_of_one_gear(one, at))
    force = case.model(case.soil, at)
    return force if case.remainder is None else case.remainder.added_to(force, at.slip, at.load)


def _readings_by_gear(
    case: Case, coordinates: Sequence[Coordinate], readings: Readings
) -> Iterator[tuple[Case, list[Coordinate], Readings, Integers, Integers, Integers]]:
    """The readings of each gear of a case with several; a gear without readings is left out.

    Case, coordinates and readings of the gear, and positions among all: of the coordinates that act
    on it, of its rows and of its readings.
    """
    for gear in rows_by_gear(case, readings.at):
        selected, own = readings.of_rows(gear.rows, gear.at)
        if selected.any():
            kept = [i for i, c in enumerate(coordinates) if c.path in gear.paths]
            free = [replace(coordinates[i], path=gear.paths[coordinates[i].path]) for i in kept]
            at, chosen = np.asarray(kept, dtype=np.int64), np.flatnonzero(selected)
            yield gear.case, free, own, at, gear.rows, chosen


def _of_rows(start: SinkageEstimate | None, rows: Integers) -> SinkageEstimate | None:
    """The estimate (sets, n) of some rows, if there is one."""
    if start is None:
        return None
    return replace(start, log_sinkage=start.log_sinkage[:, rows], slope=start.slope[:, rows])


def _raveled(start: SinkageEstimate | None) -> SinkageEstimate | None:
    """An estimate (sets, n) as one of the rows of all sets, if there is one."""
    if start is None:
        return None
    return replace(start, log_sinkage=np.ravel(start.log_sinkage), slope=np.ravel(start.slope))


def _load_case(case: Case, coordinates: Sequence[Coordinate], x: Floats, at: Operating) -> LoadCase:
    """All sets of values x (sets, p) at all operating points (n,), points within sets."""
    points = np.broadcast(at.slip, at.load).size
    values = {c.path: c.value(x[:, i]) for i, c in enumerate(coordinates)}
    known = {name: getattr(at, name) for name in ("slip", "load", *COVARIATES)}
    repeated = {
        name: (np.zeros((len(x), points)) + value).ravel()
        for name, value in known.items()
        if value is not None
    }
    model = case.model
    whole = LoadCase(model.gear, case.soil, Operating(**repeated), model.effects, Resolution.FIT)
    numbers: list[Floats] = []
    for path, (parameter, own) in located(whole).items():
        of_case = path.removeprefix("soil.").removeprefix("effects.")
        value = values.get(of_case, own)
        check_number(path.removeprefix("at.").replace("soil.", "soil "), parameter, value)
        array = np.repeat(value, points) if of_case in values else np.asarray(value, np.float64)
        numbers.append(array)
    in_order = iter(numbers)
    return mapped(whole, lambda _: next(in_order))


def _linearised(
    case: Case,
    coordinates: Sequence[Coordinate],
    x: Floats,
    readings: Readings,
    start: SinkageEstimate | None,
) -> Linearisation:
    """The linearisation of a case of one gear; see `linearise`."""
    upper = np.asarray([coordinate.upper for coordinate in coordinates])
    step = np.where(x + DIFFERENCE_STEP <= upper, DIFFERENCE_STEP, -DIFFERENCE_STEP)
    sets, points = np.concatenate([x[None, :], x + np.diag(step)]), len(readings.run)
    load_case = _load_case(case, coordinates, sets, readings.at)
    base = np.tile(np.arange(points), len(sets))
    response = linear_response(load_case, base, _raveled(start))
    here, *moved = _stacked(case, readings, response.force)
    change = np.reshape(moved, (len(x), len(here))) - here
    if np.any(np.isfinite(here) & ~np.isfinite(change.sum(axis=0))):
        # the load carried does not rise with sinkage at every equilibrium that a search accepts
        change = predict(case, coordinates, sets[1:], readings) - here
    log_sinkage = response.sinkage.log_sinkage.reshape(len(sets), points)
    return Linearisation(
        x=x,
        prediction=here,
        jacobian=np.asarray((change / step[:, None]).T),
        log_sinkage=log_sinkage[0],
        log_sinkage_rate=(log_sinkage[1:] - log_sinkage[0]) / step[:, None],
        slope=response.sinkage.slope[:points],
    )


def _stacked(case: Case, readings: Readings, force: Force) -> Floats:
    """Readings (sets, m) from the forces of all sets, with the mean of the remainder."""
    points = len(readings.run)
    y = readings.stack(
        {name: np.reshape(getattr(force, name), (-1, points)) for name in readings.channels}
    )
    for i, name in enumerate(readings.channels):
        if case.remainder is not None and case.remainder.of(name):
            own = readings.channel == i
            at = readings.slip[own], readings.load[own]
            y[:, own] += case.remainder.mean_and_std(name, *at)[0]
    return y
