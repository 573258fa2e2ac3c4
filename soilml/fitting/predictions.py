"""What cases predict for readings, and how that changes with the coordinates: many at once.

A request goes this way: `predict_many` or `linearise_many` divide it by gear (`_by_gear`), gather
requests whose rows the model can solve together (`_answered`, `joined_cases`), solve them in one
call of the physics (`_predict_joined`, `_linearise_joined`), and take from its forces the readings
of each request (`_stacked`), adding the mean of the remainder. `predict`, `linearise` and
`predict_channels` request for one case.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from graphlib import CycleError
from typing import Any, TypeVar

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.config.case import Case
from soilml.errors import InputError, raised
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.joined_cases import CaseSets, join_keys, joined_load_case
from soilml.fitting.mixtures import mixed_forces
from soilml.fitting.operating_points import rows_by_gear
from soilml.fitting.readings import Readings
from soilml.physics.contact import Force
from soilml.physics.equilibrium import sensor_readings
from soilml.physics.linear_response import linear_response
from soilml.physics.model import in_chunks_near
from soilml.physics.operating_point import Operating
from soilml.physics.sinkage_estimate import SinkageEstimate
from soilml.quantities import CHANNELS

T = TypeVar("T")

#: Step of the difference quotients, in units of the coordinate: rounding errors of a reading at
#: given sinkage (1e-14 of it) and curvature then both stay below 1e-5 of a derivative.
DIFFERENCE_STEP = 1e-6


@dataclass(frozen=True)
class GearReadings:
    """The readings of one gear, with its case and the coordinates that act on it."""

    case: Case
    coordinates: list[Coordinate]
    kept: Integers  # (p,) positions of these coordinates among all
    readings: Readings
    rows: Integers  # (n,) positions of the rows
    selected: Integers  # (m,) positions of the readings


def readings_by_gear(
    case: Case, coordinates: Sequence[Coordinate], readings: Readings
) -> list[GearReadings]:
    """The readings of each gear of a case with several; none where there is one gear.

    A gear without readings is left out.
    """
    parts: list[GearReadings] = []
    for gear in rows_by_gear(case, readings.at) if case.gears else ():
        selected, own = readings.of_rows(gear.rows, gear.at)
        if selected.any():
            kept = [i for i, c in enumerate(coordinates) if c.path in gear.paths]
            free = [replace(coordinates[i], path=gear.paths[coordinates[i].path]) for i in kept]
            at, chosen = np.asarray(kept, dtype=np.int64), np.flatnonzero(selected)
            parts.append(GearReadings(gear.case, free, at, own, gear.rows, chosen))
    return parts


@dataclass(frozen=True)
class PredictionRequest:
    """The readings that a case predicts at sets of coordinates, x (sets, p).

    `estimate`, (sets, n) for the n operating points, is where the searches for equilibrium start;
    see `soilml.physics.sinkage_estimate.SinkageEstimate`.
    """

    case: Case
    coordinates: Sequence[Coordinate]
    x: Floats
    readings: Readings
    estimate: SinkageEstimate | None = None

    def of_gear(self, part: GearReadings) -> PredictionRequest:
        """The same for the readings of one of several gears."""
        estimate = self.estimate
        if estimate is not None:
            log_sinkage, slope = estimate.log_sinkage[:, part.rows], estimate.slope[:, part.rows]
            estimate = replace(estimate, log_sinkage=log_sinkage, slope=slope)
        return PredictionRequest(
            part.case, part.coordinates, self.x[:, part.kept], part.readings, estimate
        )

    def case_sets(self, x: Floats) -> CaseSets:
        """The case at coordinates x (sets, p)."""
        values = {c.path: c.value(x[:, i]) for i, c in enumerate(self.coordinates)}
        return CaseSets(self.case, len(x), values, self.readings.at)


@dataclass(frozen=True)
class Linearisation:
    """Predictions of m readings at coordinates x (p,), and their first-order changes."""

    x: Floats  # (p,)
    prediction: Floats  # (m,)
    jacobian: Floats  # (m, p)
    log_sinkage: Floats  # (n,) logarithm of the sinkage in m
    log_sinkage_rate: Floats  # (p, n)
    slope: Floats  # (n,), d ln W / d ln z

    def sinkage_at(self, change: Floats) -> SinkageEstimate:
        """Sinkage (sets, n) where the coordinates have changed by `change` (sets, p)."""
        log_sinkage = self.log_sinkage + change @ self.log_sinkage_rate
        return SinkageEstimate(log_sinkage, np.broadcast_to(self.slope, log_sinkage.shape))


def predict_many(requests: Sequence[PredictionRequest]) -> list[Floats | InputError]:
    """Predictions (sets, m) of each request; NaN where there is no equilibrium.

    A request whose values the model refuses has the `InputError` in place of predictions.
    """
    return _by_gear(requests, lambda own: _answered(own, _predict_joined), _joined_predictions)


def linearise_many(requests: Sequence[PredictionRequest]) -> list[Linearisation | InputError]:
    """Linearisations at the one set of coordinates, x (1, p), of each request.

    One-sided differences at the sinkage of the equilibrium at x; see
    `soilml.physics.linear_response`. The step points downwards for a coordinate at its upper
    bound. A reading without equilibrium is NaN, and so are its derivatives. An `InputError` is
    returned as by `predict_many`.
    """
    return _by_gear(requests, _linearise_each, _joined_linearisations)


def predict(case: Case, coordinates: Sequence[Coordinate], x: Floats, readings: Readings) -> Floats:
    """Predictions (sets, m) at coordinates `x` (sets, p); NaN where there is no equilibrium."""
    (prediction,) = predict_many([PredictionRequest(case, coordinates, x, readings)])
    return raised(prediction)


def linearise(
    case: Case,
    coordinates: Sequence[Coordinate],
    x: Floats,
    readings: Readings,
    near: Linearisation | None = None,
) -> Linearisation:
    """Predictions at `x` (p,) and their derivatives; see `linearise_many`.

    A linearisation `near` x, of the same coordinates, shows where the search for equilibrium
    starts.
    """
    start = None if near is None else near.sinkage_at((x - near.x)[None, :])
    (found,) = linearise_many([PredictionRequest(case, coordinates, x[None, :], readings, start)])
    return raised(found)


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


def _linearise_each(requests: Sequence[PredictionRequest]) -> list[Linearisation | InputError]:
    found = _answered(requests, _linearise_joined)
    return [
        one if isinstance(one, InputError) else _with_derivatives(request, one)
        for request, one in zip(requests, found, strict=True)
    ]


def _by_gear(
    requests: Sequence[PredictionRequest],
    answer: Callable[[Sequence[PredictionRequest]], list[T | InputError]],
    join: Callable[[PredictionRequest, Sequence[GearReadings], Sequence[T]], T],
) -> list[T | InputError]:
    """Answers to all requests; one of several gears is asked for each gear, and joined again."""
    parts = [readings_by_gear(r.case, r.coordinates, r.readings) for r in requests]
    asked: list[PredictionRequest] = []
    for request, own in zip(requests, parts, strict=True):
        asked += [request.of_gear(part) for part in own] if request.case.gears else [request]
    found = iter(answer(asked))
    answers: list[T | InputError] = []
    for request, own in zip(requests, parts, strict=True):
        if not request.case.gears:
            answers.append(next(found))
            continue
        each = [next(found) for _ in own]
        known = [one for one in each if not isinstance(one, InputError)]
        refused = (one for one in each if isinstance(one, InputError))
        answers.append(next(refused, None) or join(request, own, known))
    return answers


def _joined_predictions(
    request: PredictionRequest, parts: Sequence[GearReadings], found: Sequence[Floats]
) -> Floats:
    y = np.full((len(request.x), len(request.readings)), np.nan)
    for part, own in zip(parts, found, strict=True):
        y[:, part.selected] = own
    return y


def _joined_linearisations(
    request: PredictionRequest, parts: Sequence[GearReadings], found: Sequence[Linearisation]
) -> Linearisation:
    """Linearisations of each gear together: a coordinate changes nothing where it does not act."""
    m, n, p = len(request.readings), len(request.readings.run), len(request.coordinates)
    joined = Linearisation(
        x=request.x[0],
        prediction=np.full(m, np.nan),
        jacobian=np.zeros((m, p)),
        log_sinkage=np.full(n, np.nan),
        log_sinkage_rate=np.zeros((p, n)),
        slope=np.full(n, np.nan),
    )
    for part, own in zip(parts, found, strict=True):
        joined.prediction[part.selected] = own.prediction
        joined.jacobian[np.ix_(part.selected, part.kept)] = own.jacobian
        joined.log_sinkage[part.rows] = own.log_sinkage
        joined.log_sinkage_rate[np.ix_(part.kept, part.rows)] = own.log_sinkage_rate
        joined.slope[part.rows] = own.slope
    return joined


def _answered(
    requests: Sequence[PredictionRequest], answer: Callable[[Sequence[PredictionRequest]], list[T]]
) -> list[T | InputError]:
    """Answers to all requests, those that can be joined together; else one by one."""
    keys = join_keys([CaseSets(r.case, len(r.x), {}, r.readings.at) for r in requests])
    groups: dict[object, list[int]] = {}
    for i, (request, own) in enumerate(zip(requests, keys, strict=True)):
        near = request.estimate
        key = own, None if near is None else (near.nearest, near.rough)
        groups.setdefault(key, []).append(i)
    answers: dict[int, T | InputError] = {}
    for group in groups.values():
        try:
            found = answer([requests[i] for i in group])
            answers |= dict(zip(group, found, strict=True))
        except (InputError, CycleError) as error:
            if len(group) > 1:
                answers |= {i: _answered([requests[i]], answer)[0] for i in group}
            else:
                answers[group[0]] = error if isinstance(error, InputError) else InputError(error)
    return [answers[i] for i in range(len(requests))]


def _predict_joined(requests: Sequence[PredictionRequest]) -> list[Floats]:
    parts = [request.case_sets(request.x) for request in requests]
    load_case = joined_load_case(parts)
    with np.errstate(all="ignore"):  # rows without an answer are flagged, not warned about
        force = in_chunks_near(load_case, sensor_readings, _joined_estimate(requests))
    predictions, start = [], 0
    for request, part in zip(requests, parts, strict=True):
        size = part.sets * part.points
        predictions.append(_stacked(request, force, slice(start, start + size)))
        start += size
    return predictions


def _linearise_joined(requests: Sequence[PredictionRequest]) -> list[Linearisation]:
    steps = [_difference_steps(request) for request in requests]
    parts, base, start = [], [], 0
    for request, step in zip(requests, steps, strict=True):
        part = request.case_sets(np.concatenate([request.x, request.x + np.diag(step)]))
        base.append(start + np.tile(np.arange(part.points), part.sets))
        start += part.sets * part.points
        parts.append(part)
    response = linear_response(
        joined_load_case(parts), np.concatenate(base), _joined_estimate(requests)
    )
    linearisations, start = [], 0
    for request, part, step in zip(requests, parts, steps, strict=True):
        rows = slice(start, start + part.sets * part.points)
        y = _stacked(request, response.force, rows)
        log_sinkage = response.sinkage.log_sinkage[rows].reshape(part.sets, part.points)
        linearisations.append(
            Linearisation(
                x=request.x[0],
                prediction=y[0],
                jacobian=np.asarray(((y[1:] - y[0]) / step[:, None]).T),
                log_sinkage=log_sinkage[0],
                log_sinkage_rate=(log_sinkage[1:] - log_sinkage[0]) / step[:, None],
                slope=response.sinkage.slope[rows][: part.points],
            )
        )
        start = rows.stop
    return linearisations


def _with_derivatives(request: PredictionRequest, found: Linearisation) -> Linearisation:
    """The linearisation with difference quotients of predictions where it has no derivatives.

    The load carried does not rise with sinkage at every equilibrium that the search accepts.
    """
    if not np.any(np.isfinite(found.prediction) & ~np.isfinite(found.jacobian.sum(axis=1))):
        return found
    step = _difference_steps(request)
    sets = replace(request, x=request.x + np.diag(step), estimate=None)
    (moved,) = _predict_joined([sets])
    return replace(found, jacobian=((moved - found.prediction) / step[:, None]).T)


def _difference_steps(request: PredictionRequest) -> Floats:
    """The step of each coordinate, (p,), away from an upper bound that is near."""
    upper = np.asarray([coordinate.upper for coordinate in request.coordinates])
    return np.where(request.x[0] + DIFFERENCE_STEP <= upper, DIFFERENCE_STEP, -DIFFERENCE_STEP)


def _joined_estimate(requests: Sequence[PredictionRequest]) -> SinkageEstimate | None:
    """The estimates of all requests, or None where they have none."""
    estimates = [request.estimate for request in requests if request.estimate is not None]
    if not estimates:
        return None
    return SinkageEstimate(
        np.concatenate([np.ravel(estimate.log_sinkage) for estimate in estimates]),
        np.concatenate([np.ravel(estimate.slope) for estimate in estimates]),
        estimates[0].nearest,
        estimates[0].rough,
    )


def _stacked(request: PredictionRequest, force: Force, rows: slice) -> Floats:
    """Readings (sets, m) from the forces of these rows, with the mean of the remainder."""
    readings = request.readings
    points = np.size(readings.at.slip)
    channels = {
        name: np.asarray(getattr(force, name))[rows].reshape(-1, points)
        for name in readings.channels
    }
    return readings.stack(channels) + remainder_at(request.case, readings)


def remainder_at(case: Case, readings: Readings) -> Floats:
    """Mean (m,) of the remainder of a case of one gear; it does not depend on soil and effects."""
    mean = np.zeros(len(readings))
    for i, name in enumerate(readings.channels):
        if case.remainder is not None and case.remainder.of(name):
            own = readings.channel == i
            at = readings.slip[own], readings.load[own]
            mean[own] = case.remainder.mean_and_std(name, *at)[0]
    return mean
