"""Errors of all rows that act on the readings alone, at given predictions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.fitting.observations import Observations

Floats = NDArray[np.float64]


def sensor_columns(data: Observations, prediction: Floats) -> Floats | None:
    r"""Changes (sets, k, e) of the readings with gains and offsets of one standard deviation.

    .. math:: y = (1 + e_1) f + e_2

    for torque and sinkage; drawbar pull has an error in proportion to load instead of a gain. Gains
    and shares of load that grow with slip are in proportion to it. All are linear in the errors at
    predictions f (sets, k), so that errors with normal priors are integrated out without
    approximation: their covariance is that of the columns. None without such errors of a measured
    channel.
    """
    prediction = np.nan_to_num(prediction)
    errors, parts, stop = data.shared_errors, [], 0
    for channel in data.channels:
        measured = np.isfinite(channel.reading)
        start, stop = stop, stop + int(measured.sum())
        own_size, slip = prediction[:, start:stop], np.abs(data.slip[measured])
        load = data.load[measured]
        factors: dict[str, tuple[str, Floats | float]] = {
            "torque_gain": ("torque", own_size),
            "torque_bias": ("torque", 1.0),
            "torque_by_slip": ("torque", own_size * slip),
            "sinkage": ("sinkage", own_size),
            "sinkage_bias": ("sinkage", 1.0),
            "sinkage_by_slip": ("sinkage", own_size * slip),
            "drawbar_pull": ("drawbar_pull", load),
            "drawbar_pull_bias": ("drawbar_pull", 1.0),
            "drawbar_pull_by_slip": ("drawbar_pull", load * slip),
        }
        for name, (own, factor) in factors.items():
            if name in errors and own == channel.name:
                parts.append((start, stop, errors[name] * factor))
    if not parts:
        return None
    columns = np.zeros((len(prediction), stop, len(parts)))
    for i, (start, stop, change) in enumerate(parts):
        columns[:, start:stop, i] = change
    return columns
