"""What a case predicts for measured rows, for many parameter sets at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.identification.data.observations import Observations
from soilml.identification.data.operating_points import rows_by_gear
from soilml.identification.free_parameters import FreeParameter
from soilml.physics.contact import Force
from soilml.physics.linear_response import linear_response
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, column

Floats = NDArray[np.float64]
Predictor = Callable[[Case, Sequence[FreeParameter], Floats, Operating], dict[str, Floats]]

#: Step of differences, as a fraction of the prior: rounding errors of a reading at given sinkage
#: (1e-14 of it) and curvature then both stay below 1e-5 of a derivative.
STEP = 1e-6


def predict_channels(
    case: Case, free: Sequence[FreeParameter], u: Floats, at: Operating
) -> dict[str, Floats]:
    """Each channel (sets, rows) for parameter sets `u` (sets, p) as fractions of their priors."""
    if case.gears:
        return _by_gear(predict_channels, case, free, u, at)
    changed = _changed(case, free, u)
    force = changed.model(changed.soil, at)
    return _channels(force, np.shape(force.torque), len(u))


def _changed(case: Case, free: Sequence[FreeParameter], u: Floats) -> Case:
    """The case at parameter sets `u` (sets, p), its free parameters of shape (sets, 1)."""
    return case.with_values({f.path: f.prior.at(u[:, i])[:, None] for i, f in enumerate(free)})


def _channels(force: Force, shape: tuple[int, ...], sets: int) -> dict[str, Floats]:
    """Each channel (sets, rows) of forces whose shape is (sets, rows), (1, rows) or (rows,)."""
    return {
        name: np.broadcast_to(np.reshape(getattr(force, name), shape), (sets, shape[-1]))
        for name in CHANNELS
    }


def forces(case: Case, at: Operating) -> Force:
    """Forces (n,) of a case at operating points (n,), which several gears may have driven."""
    if not case.gears:
        return case.model(case.soil, at)
    count = np.broadcast(at.slip, at.load).size
    joined: dict[str, Any] = {
        f.name: np.zeros(count, np.int64 if f.name == "status" else np.float64)
        for f in fields(Force)
    }
    for part in rows_by_gear(case, at):
        force = part.case.model(part.case.soil, part.at)
        for name, values in joined.items():
            values[part.rows] = getattr(force, name)
    return Force(**joined)


def _by_gear(
    predict: Predictor, case: Case, free: Sequence[FreeParameter], u: Floats, at: Operating
) -> dict[str, Floats]:
    """The same for rows of several gears, with one call for each gear."""
    total = {name: np.full((len(u), np.shape(at.slip)[0]), np.nan) for name in CHANNELS}
    for part in rows_by_gear(case, at):
        kept = [i for i, f in enumerate(free) if f.path in part.paths]
        own = [replace(free[i], path=part.paths[free[i].path]) for i in kept]
        for name, values in predict(part.case, own, u[:, kept], part.at).items():
            total[name][:, part.rows] = values
    return total


def stack_channels(data: Observations, channels: dict[str, Floats]) -> Floats:
    """Channels (sets, rows) where they were measured, one after another: (sets, k)."""
    parts = [channels[c.name][:, np.isfinite(c.reading)] for c in data.channels]
    return np.concatenate(parts, axis=1)


def stacked_readings(data: Observations) -> tuple[Floats, Floats]:
    """All k readings, one channel after another, and their declared standard deviations, (k,)."""
    kept = [np.isfinite(c.reading) for c in data.channels]
    reading = [c.reading[k] for c, k in zip(data.channels, kept, strict=True)]
    std = [c.std[k] for c, k in zip(data.channels, kept, strict=True)]
    return np.concatenate(reading), np.concatenate(std)


def noise_at_prediction(case: Case, data: Observations, prediction: Floats) -> Floats:
    """Standard deviations (sets, k) of the readings, those of [noise] taken at the predictions.

    `prediction` has the shape (sets, k). Standard deviations that the table gives stay as they are,
    and so do those of readings without a prediction or with a predicted deviation of zero.
    """
    declared = stacked_readings(data)[1]
    parts, stop = [], 0
    for channel in data.channels:
        measured = np.isfinite(channel.reading)
        start, stop = stop, stop + int(measured.sum())
        noise = case.noise.get(column(channel.name))
        own = declared[start:stop]
        if noise is None or noise.share == 0.0:
            parts.append(np.broadcast_to(own, (len(prediction), len(own))))
            continue
        from_case = own == noise.std(channel.reading[measured])
        expected = noise.std(prediction[:, start:stop])
        parts.append(np.where(from_case & (expected > 0), expected, own))
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)


def linearise(
    case: Case, data: Observations, free: Sequence[FreeParameter], u: Floats
) -> tuple[Floats, Floats]:
    """Predictions (k,) at `u` (p,) and their Jacobian (k, p), by the implicit function theorem.

    One search for equilibrium, and one evaluation for each parameter at the sinkage found; see
    `soilml.physics.linear_response`. The steps point away from a bound.
    """
    step = np.where(u + STEP <= 1.0, STEP, -STEP)
    sets = np.concatenate([u[None, :], u + np.diag(step)])
    y = stack_channels(data, _response_of_channels(case, free, sets, data.at))
    return y[0], np.asarray(((y[1:] - y[0]) / step[:, None]).T)


def _response_of_channels(
    case: Case, free: Sequence[FreeParameter], u: Floats, at: Operating
) -> dict[str, Floats]:
    """Each channel (sets, rows), linear in the distance of `u` (sets, p) from its first row."""
    if case.gears:
        return _by_gear(_response_of_channels, case, free, u, at)
    changed = _changed(case, free, u)
    load_case, shape = changed.model.load_case(changed.soil, at)
    # without a free parameter that acts here, all sets are the first one
    base = np.tile(np.arange(shape[-1]), shape[0] if len(shape) == 2 else 1)
    return _channels(linear_response(load_case, base).reading, shape, len(u))


def propagated_input_noise(
    case: Case,
    free: Sequence[FreeParameter],
    u: Floats,
    at: Operating,
    slip_std: Floats,
    load_std: Floats,
) -> dict[str, Floats]:
    """Standard deviation (1, rows) of each channel that noise of slip and load causes.

    First-order propagation at the parameters `u` (p,): the change over one standard deviation,
    centred. Zero where a prediction is missing.
    """
    slip, load = np.asarray(at.slip), np.asarray(at.load)
    total = {name: np.zeros((1, slip.size)) for name in CHANNELS}
    for name, std in (("slip", slip_std), ("load", load_std)):
        if not np.any(std > 0.0):
            continue
        below, above = (
            _with_input_error(at, name, sign * 0.5 * std, slip, load) for sign in (-1.0, 1.0)
        )
        low = predict_channels(case, free, u[None, :], below)
        high = predict_channels(case, free, u[None, :], above)
        for channel, own in total.items():
            total[channel] = np.hypot(own, np.nan_to_num(high[channel] - low[channel]))
    return total


def _with_input_error(
    at: Operating, name: str, error: Floats, slip: Floats, load: Floats
) -> Operating:
    """Operating points with an error in slip or load, kept where the model is defined."""
    values = {"slip": slip, "load": load}
    values[name] = values[name] + error
    return replace(
        at,
        slip=np.clip(values["slip"], -0.999, 0.999),
        load=np.clip(values["load"], 1e-3 * load, 2.0 * load),
    )
