"""What a case predicts for measured rows, for many parameter sets at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.free_parameters import FreeParameter
from soilml.fitting.observations import Observations
from soilml.fitting.operating_points import rows_by_gear
from soilml.physics.contact import Force
from soilml.physics.linear_response import linear_response
from soilml.physics.operating_point import Operating
from soilml.physics.sinkage_estimate import SinkageEstimate
from soilml.quantities import CHANNELS, column

Floats = NDArray[np.float64]
#: Positions of rows among all.
Rows = NDArray[np.int64] | slice
Predictor = Callable[[Case, Sequence[FreeParameter], Floats, Operating, Rows], dict[str, Floats]]

#: Step of differences, as a fraction of the prior: rounding errors of a reading at given sinkage
#: (1e-14 of it) and curvature then both stay below 1e-5 of a derivative.
STEP = 1e-6
#: Names, beside the channels, of what else a response tells of each row.
LOG_SINKAGE, SLOPE = "log_sinkage", "slope"


def predict_channels(
    case: Case, free: Sequence[FreeParameter], u: Floats, at: Operating
) -> dict[str, Floats]:
    """Each channel (sets, rows) for parameter sets `u` (sets, p) as fractions of their priors."""

    def predict(
        case: Case, free: Sequence[FreeParameter], u: Floats, at: Operating, rows: Rows
    ) -> dict[str, Floats]:
        changed = _changed(case, free, u)
        force = changed.model(changed.soil, at)
        return _channels(force, np.shape(force.torque), len(u))

    return _by_gear(predict, case, free, u, at)


def _changed(case: Case, free: Sequence[FreeParameter], u: Floats) -> Case:
    """The case at parameter sets `u` (sets, p), its free parameters of shape (sets, 1)."""
    return case.with_values({f.path: f.prior.at(u[:, i])[:, None] for i, f in enumerate(free)})


def _channels(force: Force, shape: tuple[int, ...], sets: int) -> dict[str, Floats]:
    """Each channel (sets, rows) of forces whose shape is (sets, rows), (1, rows) or (rows,)."""
    return {name: _each_set(getattr(force, name), shape, sets) for name in CHANNELS}


def _each_set(values: Floats, shape: tuple[int, ...], sets: int) -> Floats:
    """Values of the model (sets, rows), which may be the same for all sets."""
    return np.broadcast_to(np.reshape(values, shape), (sets, shape[-1]))


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
    """What is predicted for each row (sets, rows), with one call for each gear of the case."""
    if not case.gears:
        return predict(case, free, u, at, slice(None))
    total: dict[str, Floats] = {}
    for part in rows_by_gear(case, at):
        kept = [i for i, f in enumerate(free) if f.path in part.paths]
        own = [replace(free[i], path=part.paths[free[i].path]) for i in kept]
        for name, values in predict(part.case, own, u[:, kept], part.at, part.rows).items():
            empty = np.full((len(u), np.shape(at.slip)[0]), np.nan)
            total.setdefault(name, empty)[:, part.rows] = values
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


@dataclass(frozen=True)
class Linearisation:
    """Readings to first order about fractions `u` (p,) of the priors, and the sinkage of each row.

    Attributes
    ----------
    u
        Fractions (p,).
    prediction, jacobian
        Readings (k,) and their derivatives (k, p).
    log_sinkage, rate
        ln(z / m) of the rows (n,), and its derivatives (p, n); NaN without equilibrium.
    slope
        d ln W / d ln z, (n,).
    """

    u: Floats
    prediction: Floats
    jacobian: Floats
    log_sinkage: Floats
    rate: Floats
    slope: Floats

    def sinkage_at(self, u: Floats) -> SinkageEstimate:
        """Where the search for equilibrium may start at other fractions (p,)."""
        return SinkageEstimate(self.log_sinkage + (u - self.u) @ self.rate, self.slope)


def linearise(
    case: Case,
    data: Observations,
    free: Sequence[FreeParameter],
    u: Floats,
    near: Linearisation | None = None,
) -> Linearisation:
    """Predictions at `u` (p,) and their Jacobian, by the implicit function theorem.

    One search for equilibrium, which starts from a linearisation `near` `u` if there is one, and
    one evaluation for each parameter at the sinkage found; see `soilml.physics.linear_response`.
    The steps point away from a bound.
    """
    step = np.where(u + STEP <= 1.0, STEP, -STEP)[:, None]
    sets = np.concatenate([u[None, :], u + np.diag(step[:, 0])])
    estimate = None if near is None else near.sinkage_at(u)

    def response(
        case: Case, free: Sequence[FreeParameter], u: Floats, at: Operating, rows: Rows
    ) -> dict[str, Floats]:
        return _response_of_channels(case, free, u, at, _of_rows(estimate, rows))

    found = _by_gear(response, case, free, sets, data.at)
    y, log_sinkage = stack_channels(data, found), found[LOG_SINKAGE]
    return Linearisation(
        u,
        y[0],
        np.asarray(((y[1:] - y[0]) / step).T),
        log_sinkage[0],
        (log_sinkage[1:] - log_sinkage[0]) / step,
        found[SLOPE][0],
    )


def _of_rows(estimate: SinkageEstimate | None, rows: Rows) -> SinkageEstimate | None:
    if estimate is None:
        return None
    return SinkageEstimate(estimate.log_sinkage[rows], estimate.slope[rows])


def _response_of_channels(
    case: Case,
    free: Sequence[FreeParameter],
    u: Floats,
    at: Operating,
    estimate: SinkageEstimate | None,
) -> dict[str, Floats]:
    """Each channel (sets, rows), linear in the distance of `u` (sets, p) from its first row.

    And so the logarithm of sinkage, and the slope of the load there.
    """
    changed = _changed(case, free, u)
    load_case, shape = changed.model.load_case(changed.soil, at)
    # without a free parameter that acts here, all sets are the first one
    base = np.tile(np.arange(shape[-1]), shape[0] if len(shape) == 2 else 1)
    response = linear_response(load_case, base, estimate)
    sinkage = {LOG_SINKAGE: response.sinkage.log_sinkage, SLOPE: response.sinkage.slope}
    return _channels(response.reading, shape, len(u)) | {
        name: _each_set(values, shape, len(u)) for name, values in sinkage.items()
    }


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
