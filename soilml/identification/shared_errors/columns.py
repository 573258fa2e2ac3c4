"""How readings change with errors that all rows share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.identification.data.observations import Observations
from soilml.identification.data.operating_points import rows_by_gear
from soilml.identification.free_parameters import FreeParameter
from soilml.identification.predictions import stack_channels, stacked_readings
from soilml.numerics.noise_and_process import Whitener
from soilml.physics.effects.soil.exit_angle import ExitAngle
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS

Floats = NDArray[np.float64]

#: Steps towards the most probable errors at given parameters.
STEPS = 3
#: Farthest from zero that an error is looked for, in standard deviations.
FARTHEST = 4.0
#: Largest slip at which the model is evaluated.
MOST_SLIP = 0.999


@dataclass(frozen=True)
class SharedErrors:
    r"""Readings as a linear function of errors e, in their standard deviations.

    .. math:: y(\theta, e) \approx y(\theta, 0) + d + C e

    Integrated over the normal prior of e, residuals have the mean of those of :math:`y + d` and the
    covariance :math:`C C^T` beside that of noise.

    Attributes
    ----------
    offset
        d, (k,).
    columns
        C, (k, e).
    """

    offset: Floats
    columns: Floats

    @staticmethod
    def none(readings: int) -> SharedErrors:
        """For readings (k,) without such errors."""
        return SharedErrors(np.zeros(readings), np.zeros((readings, 0)))


def linearised_errors(
    case: Case,
    free: Sequence[FreeParameter],
    u: Floats,
    data: Observations,
    std: Floats,
    process: Floats,
) -> SharedErrors:
    r"""The errors of `data`, linearised where they are most probable at given parameters.

    Columns are centred differences over one standard deviation. A reading without a prediction has
    no changes.

    Parameters
    ----------
    case, free
        The model, and its p free parameters.
    u
        Fractions (p,) of their priors.
    data
        Rows with k readings, and the sizes of the errors.
    std
        Standard deviations (k,) of the noise.
    process
        Columns (k, q) of the model discrepancy.

    References
    ----------
    Kaipio and Somersalo, J. Computational and Applied Mathematics 198(2), 2007 (errors of a model
    in the covariance of the readings); Bard, Nonlinear Parameter Estimation, 1974.
    """
    errors = data.shared_errors
    reading = stacked_readings(data)[0]
    if not errors:
        return SharedErrors.none(reading.size)
    known = case.with_values({f.path: float(f.prior.at(u[i])) for i, f in enumerate(free)})
    whitener, size = Whitener.of(std, process), len(errors)
    steps = np.concatenate([np.zeros((1, size)), 0.5 * np.eye(size), -0.5 * np.eye(size)])
    without = _readings(known, data, errors, np.zeros((1, size)))[0]
    likeliest = np.zeros(size)
    for _ in range(STEPS):
        y = _readings(known, data, errors, likeliest + steps)
        columns = np.nan_to_num(y[1 : 1 + size] - y[1 + size :]).T
        residual = np.nan_to_num(reading - y[0]) + columns @ likeliest
        basis = whitener(columns.T)
        normal = basis @ basis.T + np.eye(size)
        found = np.linalg.solve(normal, basis @ whitener(residual))
        likeliest = np.asarray(np.clip(found, -FARTHEST, FARTHEST))
    y = _readings(known, data, errors, likeliest + steps)
    columns = np.nan_to_num(y[1 : 1 + size] - y[1 + size :]).T
    return SharedErrors(np.nan_to_num(y[0] - without - columns @ likeliest), columns)


def _readings(
    case: Case, data: Observations, errors: Mapping[str, float], values: Floats
) -> Floats:
    """Stacked readings (sets, k) with errors `values` (sets, e) in standard deviations."""
    given = {name: std * values[:, i, None] for i, (name, std) in enumerate(errors.items())}
    log_load = np.log(np.abs(data.load) / np.median(np.abs(data.load)))
    if not case.gears:
        return stack_channels(data, _with_errors(case, data.at, log_load, given))
    channels = {name: np.full((len(values), len(data.slip)), np.nan) for name in CHANNELS}
    for part in rows_by_gear(case, data.at):
        own = _with_errors(part.case, part.at, log_load[part.rows], given)
        for name, found in own.items():
            channels[name][:, part.rows] = found
    return stack_channels(data, channels)


def _with_errors(
    case: Case, at: Operating, log_load: Floats, given: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Each channel (sets, rows) with errors (sets, 1) by name, in their units."""
    zero = np.zeros((len(next(iter(given.values()))), 1))

    def error(name: str) -> Floats:
        return given.get(name, zero)

    slip = np.clip(at.slip + error("slip_bias"), -MOST_SLIP, MOST_SLIP)
    load = at.load * (1.0 + error("load_gain"))
    by_row = error("bearing_by_slip") * at.slip + error("bearing_by_load") * log_load
    factor = np.exp(error("bearing") + by_row)
    soil = replace(case.soil, kc=case.soil.kc * factor, kphi=case.soil.kphi * factor)
    driven = replace(at, slip=slip, load=load)
    force = case.model(soil, driven)
    shape = np.broadcast_shapes(slip.shape, load.shape, factor.shape)
    y = {name: np.broadcast_to(getattr(force, name), shape) for name in CHANNELS}
    if "contact" in given:
        wider = (case.model + ExitAngle(**ExitAngle.about.reference))(soil, driven)
        share = error("contact")
        y = {name: v + share * (getattr(wider, name) - v) for name, v in y.items()}
    return {
        "torque": y["torque"] * (1.0 + error("torque_gain")) + error("torque_bias"),
        "drawbar_pull": y["drawbar_pull"]
        + error("drawbar_pull") * at.load
        + error("drawbar_pull_bias"),
        "sinkage": y["sinkage"] * (1.0 + error("sinkage")) + error("sinkage_bias"),
    }
