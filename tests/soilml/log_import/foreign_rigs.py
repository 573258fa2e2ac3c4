"""Logs of test rigs as their software writes them, from a wheel model of their own.

Each writer returns the files, the edits that the map needs, and the true stages.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

RADIUS = 0.13
RADIUS_EDIT = ('# radius = "0.15 m', f'radius = "{RADIUS} m')


def law(slip, load):
    """Torque, pull and sinkage of a wheel: a law as good as any."""
    torque = RADIUS * load * (0.06 + 0.62 * (1 - np.exp(-slip / 0.11)) * (1 + 0.15 * slip))
    pull = 0.93 * torque / RADIUS - 0.13 * load * (1 + 0.4 * slip)
    return torque, pull, 0.008 * (load / 50) ** 0.8 * (1 + 1.7 * slip)


@dataclass
class Samples:
    """What happened (n,), in SI units, and the true stages (slip, load)."""

    t: np.ndarray
    load: np.ndarray
    omega: np.ndarray
    v: np.ndarray
    torque: np.ndarray
    pull: np.ndarray
    sinkage: np.ndarray
    stages: list


def wander(rng, n, step, std, memory):
    keep = np.exp(-step / memory)
    return lfilter([1], [1, -keep], std * np.sqrt(1 - keep**2) * rng.standard_normal(n))


def drive(rng, slips, loads, rest=4.0, seconds=12.0, rate=25.0, speed=0.03, end=2.0, cart=False):
    """One slip after another; with `cart` the carriage keeps its speed and the wheel turns faster.

    The wheel rests before and after.
    """
    step = 1 / rate
    n = int((rest + seconds * len(slips) + end) * rate)
    t = step * np.arange(n)
    stage = np.floor((t - rest) / seconds).astype(int)
    on = (stage >= 0) & (stage < len(slips))
    stage = np.clip(stage, 0, len(slips) - 1)

    def lagged(values, time):
        return lfilter([1 - np.exp(-step / time)], [1, -np.exp(-step / time)], values)

    slip = lagged(np.where(on, np.asarray(slips)[stage], 0.0), 0.25)
    loads = np.asarray(loads, float)
    load = loads[0] + lagged(loads[stage] - loads[0], 0.4)
    act = lagged(on.astype(float), 0.1)
    rim = speed * act / (1 - slip) if cart else speed * act
    v = speed * act if cart else rim * (1 - slip)
    torque, pull, sinkage = law(slip, load)
    return Samples(
        t,
        load * (1 + wander(rng, n, step, 0.02, 0.4)),
        rim / RADIUS * (1 + wander(rng, n, step, 0.006, 0.2)),
        v * (1 + wander(rng, n, step, 0.01, 0.2)),
        torque * act * (1 + wander(rng, n, step, 0.03, 0.3)),
        act * (pull + wander(rng, n, step, 0.6, 0.3)),
        sinkage * act + 0.004 * (1 - act),
        list(zip(slips, loads, strict=True)),
    )


def noisy(rng, values, std):
    return values + std * rng.standard_normal(values.size)


def way(t, speed):
    return np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(t))])


def text(value, decimal=".", thousands="", digits=4):
    shown = f"{value:,.{digits}f}" if thousands else f"{value:.{digits}f}"
    return shown.replace(",", "\0").replace(".", decimal).replace("\0", thousands)


def table(columns, separator=",", **style):
    return [separator.join(text(x, **style) for x in row)
            for row in zip(*columns, strict=True)]  # fmt: skip
