"""Readings of tests, from arrays by row for each channel."""

from dataclasses import replace

import numpy as np

from soilml.fitting.readings import Readings


def channel_readings(points, channels, **changes):
    """Readings of channels, by name a pair of arrays (n,): reading, NaN where none, and noise."""
    n = np.asarray(points.slip).size
    reading = np.concatenate([np.broadcast_to(own[0], n) for own in channels.values()])
    std = np.concatenate([np.broadcast_to(own[1], n) for own in channels.values()])
    every = Readings.of_every_row(points, list(channels), measured=reading, std=std)
    return replace(every.subset(np.isfinite(reading)), **changes)
