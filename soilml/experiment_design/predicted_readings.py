"""What sensors would read at other slips and loads, for every sample of a belief."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.experiment_design.parameter_samples import ParameterSamples
from soilml.identification.observations import LEAST_STD, Channel, Observations
from soilml.identification.predictions import input_noise, predicted
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, column

Floats = NDArray[np.float64]


#: Share of what is believed possible that may leave the wheel stuck at a point that is advised.
STUCK = 0.05


@dataclass(frozen=True)
class PredictedReadings:
    """Readings y (c, m, n) of channels at m operating points for n samples, and their noise.

    NaN where that soil does not carry the wheel; `drivable` (m,) are points at which less than
    `STUCK` of the belief is such.
    """

    at: Operating
    channels: tuple[str, ...]
    y: Floats
    std: Floats
    drivable: NDArray[np.bool_]


def predicted_readings(case: Case, belief: ParameterSamples, at: Operating) -> PredictedReadings:
    """Predictions of all channels whose noise the case declares; `at` holds arrays (m,).

    Noise of slip and load adds to that of each channel as in the posterior, at one sample near the
    middle of the belief. Raises `InputError` where no noise is declared.
    """
    channels = tuple(name for name in CHANNELS if column(name) in case.noise)
    if not channels:
        raise InputError("what a measurement would tell needs its noise: declare it in [noise]")
    found = predicted(case, belief.free, belief.u, at)
    y = np.stack([found[name].T for name in channels])
    extra = _input_noise(case, belief, at, channels)
    std = np.stack([case.noise[column(n)].std(v) for n, v in zip(channels, y, strict=True)])
    std = belief.larger * np.hypot(std, extra[..., None])
    stuck = np.isnan(y).any(axis=0) @ belief.weights
    least = LEAST_STD * np.nan_to_num(np.abs(y)).max(axis=(1, 2), keepdims=True)
    return PredictedReadings(at, channels, y, np.fmax(std, least + 1e-12), stuck < STUCK)


def _input_noise(
    case: Case, belief: ParameterSamples, at: Operating, channels: tuple[str, ...]
) -> Floats:
    """Standard deviation (c, m) that noise of slip and load adds."""
    slip, load = np.asarray(at.slip), np.asarray(at.load)
    stds = {
        key: case.noise[key].std(value) if key in case.noise else np.zeros_like(value)
        for key, value in (("slip", slip), ("load_N", load))
    }
    blank = [Channel(name, np.zeros_like(slip), np.ones_like(slip), True) for name in channels]
    data = Observations(at, stds["slip"], stds["load_N"], tuple(blank), ())
    middle = int(np.argmin((belief.shares**2).sum(axis=1)))
    return input_noise(case, data, belief.free, belief.u[middle]).reshape(len(channels), -1)
