"""What a case predicts for measured rows, for many parameter sets at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.identification.data.observations import Observations
from soilml.identification.data.operating_points import rows_by_gear
from soilml.identification.free_parameters import FreeParameter
from soilml.physics.contact import Force
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, column

Floats = NDArray[np.float64]

#: Step of central differences, as a fraction of the prior: rounding errors of the equilibrium
#: (1e-10 of a reading) and curvature then both stay below 1e-6 of a derivative.
STEP = 1e-4


def predict_channels(
    case: Case, free: Sequence[FreeParameter], u: Floats, at: Operating
) -> dict[str, Floats]:
    """Each channel (sets, rows) for parameter sets `u` (sets, p) as fractions of their priors."""
    if case.gears:
        return _predict_by_gear(case, free, u, at)
    values = {f.path: f.prior.at(u[:, i])[:, None] for i, f in enumerate(free)}
    changed = case.with_values(values)
    force = changed.model(changed.soil, at)
    shape = (len(u), np.shape(at.slip)[0])
    return {
        "torque": np.broadcast_to(force.torque, shape),
        "drawbar_pull": np.broadcast_to(force.drawbar_pull, shape),
        "sinkage": np.broadcast_to(force.sinkage, shape),
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


def _predict_by_gear(
    case: Case, free: Sequence[FreeParameter], u: Floats, at: Operating
) -> dict[str, Floats]:
    """The same for rows of several gears, with one call of the model for each gear."""
    total = {name: np.full((len(u), np.shape(at.slip)[0]), np.nan) for name in CHANNELS}
    for part in rows_by_gear(case, at):
        kept = [i for i, f in enumerate(free) if f.path in part.paths]
        own = [replace(free[i], path=part.paths[free[i].path]) for i in kept]
        for name, values in predict_channels(part.case, own, u[:, kept], part.at).items():
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
    std, stop = np.broadcast_to(declared, prediction.shape).copy(), 0
    for channel in data.channels:
        measured = np.isfinite(channel.reading)
        start, stop = stop, stop + int(measured.sum())
        noise = case.noise.get(column(channel.name))
        if noise is None:
            continue
        own = declared[start:stop]
        from_case = own == noise.std(channel.reading[measured])
        expected = noise.std(prediction[:, start:stop])
        std[:, start:stop] = np.where(from_case & (expected > 0), expected, own)
    return std


def linearise(
    case: Case, data: Observations, free: Sequence[FreeParameter], u: Floats
) -> tuple[Floats, Floats]:
    """Predictions (k,) at `u` (p,) and their Jacobian (k, p), by central differences.

    All parameter sets go through the model in one call. At a bound the difference is one-sided.
    """
    p = len(u)
    up, down = np.minimum(u + STEP, 1.0), np.maximum(u - STEP, 0.0)
    sets = np.tile(u, (2 * p + 1, 1))
    sets[np.arange(p), np.arange(p)] = up
    sets[p + np.arange(p), np.arange(p)] = down
    y = stack_channels(data, predict_channels(case, free, sets, data.at))
    return y[-1], np.asarray(((y[:p] - y[p:-1]) / (up - down)[:, None]).T)


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
