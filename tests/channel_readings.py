"""Readings of tests, from arrays by row for each channel."""

from dataclasses import replace

import numpy as np

from soilml import Operating
from soilml.fitting.readings import Readings

#: Slip and load of four rows.
SLIP, LOAD = np.asarray([0.1, 0.3, 0.5, 0.2]), np.asarray([30.0, 60.0, 90.0, 120.0])


def channel_readings(points, channels, **changes):
    """Readings of channels, by name a pair of arrays (n,): reading, NaN where none, and noise."""
    n = np.asarray(points.slip).size
    reading = np.concatenate([np.broadcast_to(own[0], n) for own in channels.values()])
    std = np.concatenate([np.broadcast_to(own[1], n) for own in channels.values()])
    every = Readings.of_every_row(points, list(channels), measured=reading, std=std)
    return replace(every.subset(np.isfinite(reading)), **changes)


def rows_of(case, torque_std=0.05, **changes):
    """Torque in all rows, sinkage in the last three."""
    at = Operating(slip=SLIP, load=LOAD)
    force = case.model(case.soil, at)
    depth = np.where(np.arange(4) == 0, np.nan, np.asarray(force.sinkage))
    channels = {"torque": (np.asarray(force.torque), torque_std), "sinkage": (depth, 0.001)}
    return channel_readings(at, channels, **changes)
