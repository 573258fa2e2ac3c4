"""Noise of readings that noise of their slip and load causes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.coordinates import predict_readings
from soilml.fitting.readings import Readings

Floats = NDArray[np.float64]

#: Step of the differences, as a share of the standard deviation: noise is taken to first order.
STEP = 0.5
#: Largest slip of a row that is moved.
MOST_SLIP = 0.99


def noise_of_operation(case: Case, readings: Readings) -> Floats:
    r"""Standard deviation (m,) of readings by the declared noise of slip s and load W.

    .. math:: \sigma^2 = \left(\frac{\partial y}{\partial s} \sigma_s\right)^2
        + \left(\frac{\partial y}{\partial W} \sigma_W\right)^2

    with the typical noise of the rows. Rows that have no equilibrium beside them count as exact.
    That the readings of one row share their slip and load is left out, so that the noise of sets
    of several channels is overstated rather than understated.
    """
    slip, load = np.asarray(readings.at.slip), np.asarray(readings.at.load)
    square = np.zeros(len(readings))
    moves = {"slip": (slip, readings.slip_std), "load": (load, readings.load_std)}
    for name, (values, std) in moves.items():
        if std <= 0.0:
            continue
        least, most = (-MOST_SLIP, MOST_SLIP) if name == "slip" else (0.5 * load, 1.5 * load)
        ends = [np.clip(values + sign * STEP * std, least, most) for sign in (-1.0, 1.0)]
        low, high = (
            predict_readings(case, [], np.zeros((1, 0)), _moved(readings, name, end))[0]
            for end in ends
        )
        width = (ends[1] - ends[0])[readings.row]
        slope = np.nan_to_num((high - low) / np.where(width > 0.0, width, np.inf))
        square += (slope * std) ** 2
    return np.asarray(np.sqrt(square))


def _moved(readings: Readings, name: str, values: Floats) -> Readings:
    at = replace(readings.at, slip=values) if name == "slip" else replace(readings.at, load=values)
    return replace(readings, at=at)
