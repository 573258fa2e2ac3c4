"""Uncertainty of estimates that follow from readings and a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from soilml.errors import FitError
from soilml.systems.force_sensor_wheel.force_balance import SteadyRun
from soilml.systems.force_sensor_wheel.sensor_readings import SensorReadings
from soilml.systems.force_sensor_wheel.stress_profile import Floats

#: Step of the central differences, in standard deviations of the measured quantity: large enough
#: for the solver's tolerance, small enough for a first-order formula.
STEP_IN_STD = 0.25
#: Fewest turns for a jackknife: two degrees of freedom.
MIN_TURNS = 3


def jackknife_covariance(
    readings: SensorReadings, figures: Callable[[SensorReadings], Floats]
) -> Floats:
    r"""Covariance of k estimates by the jackknife over turns, (k, k).

    .. math:: C = \frac{t - 1}{t} \sum_i (x_i - \bar x)(x_i - \bar x)^T

    It covers everything that varies from turn to turn, noise and soil, and nothing that is constant
    over the turns. Raises `FitError` for fewer than three turns. References: Tukey 1958.
    """
    turns = len(readings.angle)
    if turns < MIN_TURNS:
        raise FitError(
            f"{turns} turns: the scatter between turns, and with it the uncertainty, needs "
            f"{MIN_TURNS} or more"
        )
    rows = np.arange(turns)
    leave_one_out = [
        figures(SensorReadings(readings.angle[rows != i], readings.force[rows != i])) for i in rows
    ]
    deviation = np.stack(leave_one_out) - np.mean(leave_one_out, axis=0)
    return np.asarray((turns - 1) / turns * deviation.T @ deviation)


def delta_method_covariance(at: SteadyRun, figures: Callable[[SteadyRun], Floats]) -> Floats:
    """Covariance of k estimates from the errors of slip, weight and slope, (k, k).

    First order (delta method): not valid where an estimate is strongly nonlinear within one
    standard deviation.
    """
    total: Floats = np.zeros((1, 1))
    for name in ("slip", "weight", "slope"):
        std = float(getattr(at, f"{name}_std"))
        if std > 0.0:
            value, step = float(getattr(at, name)), STEP_IN_STD * std
            up, down = (figures(replace(at, **{name: value + k * step})) for k in (1.0, -1.0))
            rate = (up - down) / (2.0 * STEP_IN_STD)
            total = total + np.outer(rate, rate)
    return total


def effective_degrees_of_freedom(total: float, jackknifed: float, turns: int) -> float:
    """Effective degrees of freedom of a variance of which a part is a jackknife estimate.

    References: Welch and Satterthwaite 1947; the other parts are treated as exactly known.
    """
    return (turns - 1) * (total / max(jackknifed, 1e-12 * total)) ** 2


def student_t_quantile(degrees_of_freedom: float) -> float:
    """The 95 % quantile of Student's t by the Cornish-Fisher series; 2 % off at two degrees."""
    z = 1.6448536
    first = (z**3 + z) / 4.0
    second = (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0
    third = (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0
    nu = degrees_of_freedom
    return z + first / nu + second / nu**2 + third / nu**3
