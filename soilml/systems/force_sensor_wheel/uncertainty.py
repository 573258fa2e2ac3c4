"""How far a figure that follows from readings and a run may be off."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from soilml.errors import FitError
from soilml.systems.force_sensor_wheel.sensor_model import Readings
from soilml.systems.force_sensor_wheel.steady_run import Run
from soilml.systems.force_sensor_wheel.stress_profile import Floats

#: A measured number is moved by this share of its standard deviation to see what it does.
NUDGE = 0.25
LEAST_TURNS = 3


def between_turns(readings: Readings, figures: Callable[[Readings], Floats]) -> Floats:
    r"""Covariance of some figures by the jackknife: each turn left out once, (k, k).

    .. math:: C = \frac{t - 1}{t} \sum_i (x_i - \bar x)(x_i - \bar x)^T

    References: Tukey 1958. It holds whatever scatters from turn to turn, noise and soil alike, and
    nothing that stays the same. Raises `FitError` for fewer than three turns.
    """
    turns = len(readings.angle)
    if turns < LEAST_TURNS:
        raise FitError(
            f"{turns} turns: the scatter between turns, and with it the uncertainty, needs "
            f"{LEAST_TURNS} or more"
        )
    rows = np.arange(turns)
    left = [figures(Readings(readings.angle[rows != i], readings.force[rows != i])) for i in rows]
    apart = np.stack(left) - np.mean(left, axis=0)
    return np.asarray((turns - 1) / turns * apart.T @ apart)


def from_run(at: Run, figures: Callable[[Run], Floats]) -> Floats:
    """Covariance of some figures from the errors of slip, weight and slope, straight lines, (k, k).

    References: the delta method. Not where a figure bends much within one standard deviation.
    """
    total: Floats = np.zeros((1, 1))
    for name in ("slip", "weight", "slope"):
        std = float(getattr(at, f"{name}_std"))
        if std > 0.0:
            value, step = float(getattr(at, name)), NUDGE * std
            up, down = (figures(replace(at, **{name: value + k * step})) for k in (1.0, -1.0))
            rate = (up - down) / (2.0 * NUDGE)
            total = total + np.outer(rate, rate)
    return total


def freedom(total: float, jackknifed: float, turns: int) -> float:
    """Degrees of freedom of a variance of which a part was found by `between_turns`.

    References: Welch and Satterthwaite 1947; the other parts are taken as known.
    """
    return (turns - 1) * (total / max(jackknifed, 1e-12 * total)) ** 2


def student(freedom: float) -> float:
    """The 95 % point of Student's t, by Cornish and Fisher's series; 2 % off at two."""
    z = 1.6448536
    first = (z**3 + z) / 4.0
    second = (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0
    third = (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0
    return z + first / freedom + second / freedom**2 + third / freedom**3
