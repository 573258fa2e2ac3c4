"""Predicted readings at other slips and loads, for every parameter sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.config.model_discrepancy import range_with_zero
from soilml.errors import InputError
from soilml.experiment_design.parameter_samples import ParameterSamples
from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.predictions import predict_channels
from soilml.fitting.readings import LEAST_RELATIVE_STD, Readings
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, column

Floats = NDArray[np.float64]


#: Largest probability of no equilibrium at a point that is advised.
MOST_FAILURE = 0.05


@dataclass(frozen=True)
class PredictedReadings:
    """Readings y (c, m, n) of channels at m operating points for n samples, and their noise.

    NaN where that soil does not carry the wheel; `drivable` (m,) are points at which the
    probability of this is less than `MOST_FAILURE`.
    """

    at: Operating
    channels: tuple[str, ...]
    y: Floats
    std: Floats
    drivable: NDArray[np.bool_]


def predicted_readings(case: Case, samples: ParameterSamples, at: Operating) -> PredictedReadings:
    """Predictions of all channels whose noise the case declares; `at` holds arrays (m,).

    Noise of slip and load is propagated as in the posterior, at the sample nearest to the mean. A
    model discrepancy is added as an error that is independent of those of other rows. Raises
    `InputError` where no noise is declared.
    """
    channels = tuple(name for name in CHANNELS if column(name) in case.noise)
    if not channels:
        raise InputError("the value of a measurement depends on its noise: declare it in [noise]")
    predicted = predict_channels(case, samples.free, samples.u, at)
    y = np.stack([predicted[name].T for name in channels])
    sensor = np.stack(
        [
            np.hypot(case.noise[column(n)].std(v), _model_error(case, n, v))
            for n, v in zip(channels, y, strict=True)
        ]
    )
    inputs = _input_noise(case, samples, at, channels)
    std = samples.noise_scale * np.hypot(sensor, inputs[..., None])
    failure = np.isnan(y).any(axis=0) @ samples.weights
    largest = np.nan_to_num(np.abs(y)).max(axis=(1, 2), keepdims=True)
    least = LEAST_RELATIVE_STD * largest + 1e-12
    return PredictedReadings(at, channels, y, np.fmax(std, least), failure < MOST_FAILURE)


def _model_error(case: Case, name: str, y: Floats) -> float:
    """Standard deviation of a channel's discrepancy; its range is that of typical readings."""
    own = case.discrepancy.get(column(name))
    if own is None:
        return 0.0
    carried = np.isfinite(y).any(axis=1)
    return own.amplitude(range_with_zero(np.nanmedian(y[carried], axis=1)))


def _input_noise(
    case: Case, samples: ParameterSamples, at: Operating, channels: Sequence[str]
) -> Floats:
    """Standard deviation (c, m) of each channel that noise of slip and load causes."""
    slip_std, load_std = (
        case.noise[key].std(value) if key in case.noise else np.zeros_like(value)
        for key, value in (("slip", np.asarray(at.slip)), ("load_N", np.asarray(at.load)))
    )
    rows = replace(Readings.of_every_row(at, channels), slip_std=slip_std, load_std=load_std)
    nearest = samples.u[int(np.argmin((samples.standardised**2).sum(axis=1)))]
    noise = noise_of_operation(case, rows, samples.free, nearest)
    return noise.reshape(len(channels), -1)
