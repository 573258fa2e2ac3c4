"""What a case predicts for measured rows, for many parameter sets at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.identification.free_parameters import FreeParameter
from soilml.identification.observations import Observations
from soilml.physics.operating_point import Operating
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Step of central differences, as a share of the prior.
STEP = 1e-4


def predicted(
    case: Case, free: Sequence[FreeParameter], u: Floats, at: Operating
) -> dict[str, Floats]:
    """Each channel (sets, rows) for parameter sets `u` (sets, p) as fractions of their priors."""
    values = {f.path: f.prior.at(u[:, i])[:, None] for i, f in enumerate(free)}
    changed = case.with_values(values)
    force = changed.model(changed.soil, at)
    shape = (len(u), len(at.slip))
    return {
        "torque": np.broadcast_to(force.torque, shape),
        "drawbar_pull": np.broadcast_to(force.drawbar_pull, shape),
        "sinkage": np.broadcast_to(force.sinkage, shape),
    }


def stack_readings(data: Observations, channels: dict[str, Floats]) -> Floats:
    """The predictions (sets, cells) in the order of the readings that there are."""
    parts = [channels[c.name][:, np.isfinite(c.reading)] for c in data.channels]
    return np.concatenate(parts, axis=1)


def readings(data: Observations) -> tuple[Floats, Floats]:
    """All readings that there are and their declared standard deviations, (cells,)."""
    kept = [np.isfinite(c.reading) for c in data.channels]
    reading = [c.reading[k] for c, k in zip(data.channels, kept, strict=True)]
    std = [c.std[k] for c, k in zip(data.channels, kept, strict=True)]
    return np.concatenate(reading), np.concatenate(std)


def noise_at_prediction(
    case: Case, data: Observations, free: Sequence[FreeParameter], u: Floats
) -> Floats:
    """Declared standard deviations (cells,), those of [noise] taken at the predictions at `u`.

    Those that the table gives stay, and so do those of readings for which nothing is predicted.
    """
    y = predicted(case, free, u[None, :], data.at)
    parts = []
    for c in data.channels:
        kept, noise = np.isfinite(c.reading), case.noise.get(column(c.name))
        std = c.std[kept]
        if noise is not None:
            expected = noise.std(y[c.name][0, kept])
            std = np.where((std == noise.std(c.reading[kept])) & (expected > 0), expected, std)
        parts.append(std)
    return np.concatenate(parts)


def linearised(
    case: Case, data: Observations, free: Sequence[FreeParameter], u: Floats
) -> tuple[Floats, Floats]:
    """Predictions (cells,) at `u` (p,) and their derivatives (cells, p), in one model call."""
    p = len(u)
    up, down = np.minimum(u + STEP, 1.0), np.maximum(u - STEP, 0.0)
    sets = np.tile(u, (2 * p + 1, 1))
    sets[np.arange(p), np.arange(p)] = up
    sets[p + np.arange(p), np.arange(p)] = down
    y = stack_readings(data, predicted(case, free, sets, data.at))
    return y[-1], np.asarray(((y[:p] - y[p:-1]) / (up - down)[:, None]).T)


def input_noise(case: Case, data: Observations, free: Sequence[FreeParameter], u: Floats) -> Floats:
    """Standard deviation (cells,) that noise of slip and load adds to the predictions at `u`."""
    total = np.zeros(data.cells)
    for name, std in (("slip", data.slip_std), ("load", data.load_std)):
        if not np.any(std > 0.0):
            continue
        points = {"slip": data.slip, "load": data.load}
        y = []
        for sign in (-1.0, 1.0):
            moved = points | {name: points[name] + sign * 0.5 * std}
            moved["slip"] = np.clip(moved["slip"], -0.999, 0.999)
            moved["load"] = np.clip(moved["load"], 1e-3 * data.load, 2.0 * data.load)
            at = replace(data.at, slip=moved["slip"], load=moved["load"])
            y.append(stack_readings(data, predicted(case, free, u[None, :], at))[0])
        total = np.hypot(total, np.nan_to_num(y[1] - y[0]))
    return np.asarray(total)
