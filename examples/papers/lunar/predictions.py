"""Accuracy of estimates and drawbar pulls over many soils of the prior, from one reading each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from lunar.pull import mean_and_interval, pull_interval, repeat_over_slips
from lunar.sweep import Floats, add_torque_noise, soils, wheel_forces
from numpy.typing import NDArray

from soilml import Case, Estimator

Mask = NDArray[np.bool_]

#: Samples of each estimate: sufficient for averages over many estimates.
DRAWS = 100


@dataclass(frozen=True)
class SimulatedReadings:
    """Soils (m, p), and their measured torque and true pull (m, k) at slips (k,) under one load."""

    soils: Floats
    slip: Floats
    load: float
    torque: Floats
    pull: Floats


@dataclass(frozen=True)
class PullPredictions:
    """Predicted drawbar pull (m, k) in N, and its 90 % interval; NaN without one."""

    pull: Floats
    low: Floats
    high: Floats

    def error(self, truth: Floats, valid: Mask | bool = True) -> float:
        """Root mean square error over the valid readings (m, k), N."""
        return float(np.sqrt(np.mean((self.pull - truth) ** 2, where=valid)))

    def coverage(self, truth: Floats, valid: Mask | bool = True) -> float:
        """Coverage of the interval over the valid readings (m, k)."""
        return float(np.mean((self.low <= truth) & (truth <= self.high), where=valid))


def simulate_readings(
    truth: Case, slip: Floats, load: float, count: int, rng: np.random.Generator
) -> SimulatedReadings:
    """Simulate readings on `count` soils of the prior with the wheel and the noise of `truth`."""
    values = soils(truth, count, rng)
    force = wheel_forces(truth, values[:, None, :], slip, load)
    return SimulatedReadings(
        values, slip, load, add_torque_noise(truth, force.torque, rng), force.drawbar_pull
    )


def predict_from_prior(
    case: Case, run: SimulatedReadings, at: Floats, rng: np.random.Generator, count: int = 2000
) -> PullPredictions:
    """Without measurement: mean pull of the prior's soils at slips `at` (k,), and its interval."""
    pulls = wheel_forces(case, soils(case, count, rng)[:, None, :], at, run.load).drawbar_pull
    return _same_for_all(pulls, run.pull)


def predict_from_torque(
    case: Case, run: SimulatedReadings, at: Floats, rng: np.random.Generator, count: int = 2000
) -> PullPredictions:
    r"""Without soil estimate: torque over the wheel's radius, less the mean loss over the prior.

    .. math:: DP = T / r - R, \qquad R = T / r - DP \text{ over soils of the prior}

    with the pull predicted at slips `at` (k,); the interval includes the sensor noise.
    """
    values = soils(case, count, rng)[:, None, :]
    radius = case.model.gear.radius
    read = add_torque_noise(case, wheel_forces(case, values, run.slip, run.load).torque, rng)
    lost = read / radius - wheel_forces(case, values, at, run.load).drawbar_pull
    found = _same_for_all(lost, run.pull)
    return PullPredictions(
        *(run.torque / radius - part for part in (found.pull, found.high, found.low))
    )


def _same_for_all(samples: Floats, like: Floats) -> PullPredictions:
    return PullPredictions(
        *(np.broadcast_to(part, like.shape) for part in mean_and_interval(samples))
    )


def predict_from_estimate(
    case: Case, estimator: Estimator, run: SimulatedReadings, at: Floats, rng: np.random.Generator
) -> PullPredictions:
    """Predict the pull at slips `at` (k,) from the estimate of each reading alone."""
    found = estimator(slip=run.slip, torque=run.torque, load=run.load)
    return PullPredictions(
        *pull_interval(case, found.mean, found.covariance, at, run.load, rng, DRAWS)
    )


def predict_from_pooled_readings(
    case: Case, estimator: Estimator, run: SimulatedReadings, at: Floats, rng: np.random.Generator
) -> PullPredictions:
    """Predict the pull at slips `at` (k,) from all readings of each soil pooled."""
    load = np.full_like(run.slip, run.load)
    found = [estimator.run(slip=run.slip, torque=row, load=load) for row in run.torque]
    mean = np.stack([one.mean for one in found])
    covariance = np.stack([one.covariance for one in found])
    return PullPredictions(
        *pull_interval(
            case, *repeat_over_slips(mean, covariance, len(at)), at, run.load, rng, DRAWS
        )
    )


def predict_from_posterior(
    case: Case, run: SimulatedReadings, at: Floats, rng: np.random.Generator, count: int = 2**14
) -> tuple[PullPredictions, Floats]:
    """Optimal prediction from each reading alone: means over the exact posterior.

    Of the drawbar pull at slips `at` (k,), and of the soil parameters, (m, k, 3).
    """
    values = soils(case, count, rng)
    pull, mean = np.empty_like(run.pull), np.empty((*run.pull.shape, 3))
    for i, slip in enumerate(run.slip):
        here = wheel_forces(case, values, slip, run.load).torque
        there = wheel_forces(case, values, at[i], run.load).drawbar_pull
        weight = _weights(case, run.torque[:, i, None], here)
        pull[:, i], mean[:, i] = weight @ there, weight @ values[:, :3]
    nothing = np.full_like(pull, np.nan)
    return PullPredictions(pull, nothing, nothing), mean


def _weights(case: Case, torque: Floats, predicted: Floats) -> Floats:
    """Importance weights (m, n) of prior samples, from one torque (m, 1) and theirs (n,)."""
    std = case.noise["torque_Nm"].std(predicted)
    logs = -0.5 * ((torque - predicted) / std) ** 2 - np.log(std)
    weight = np.exp(logs - logs.max(axis=1, keepdims=True))
    return weight / weight.sum(axis=1, keepdims=True)
