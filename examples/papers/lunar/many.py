"""How good estimates and drawbar pulls are over many soils of the prior, from one reading each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from lunar.pull import band, everywhere, spread
from lunar.sweep import Floats, driven, noisy, soils
from numpy.typing import NDArray

from soilml import Case, Estimator

Mask = NDArray[np.bool_]

#: Soils drawn of each estimate: enough for figures over many of them.
DRAWS = 100


@dataclass(frozen=True)
class Drive:
    """Soils (m, 3), each driven at slips (k,) under one load: torque read and pull, (m, k)."""

    soils: Floats
    slip: Floats
    load: float
    torque: Floats
    pull: Floats


@dataclass(frozen=True)
class Foretold:
    """Drawbar pull (m, k) in N from readings (m, k), and 90 % between; NaN without a band."""

    pull: Floats
    low: Floats
    high: Floats

    def error(self, truth: Floats, sound: Mask | bool = True) -> float:
        """Root mean square error in sound readings (m, k), N."""
        return float(np.sqrt(np.mean((self.pull - truth) ** 2, where=sound)))

    def held(self, truth: Floats, sound: Mask | bool = True) -> float:
        """Share of truths inside the band, in sound readings (m, k)."""
        return float(np.mean((self.low <= truth) & (truth <= self.high), where=sound))


def drive(truth: Case, slip: Floats, load: float, count: int, rng: np.random.Generator) -> Drive:
    """`count` soils of the prior under the wheel of `truth`, and its torque sensor's noise."""
    values = soils(truth, count, rng)
    force = driven(truth, values[:, None, :], slip, load)
    return Drive(values, slip, load, noisy(truth, force.torque, rng), force.drawbar_pull)


def by_prior(
    case: Case, run: Drive, at: Floats, rng: np.random.Generator, count: int = 2000
) -> Foretold:
    """Nothing measured: the mean pull of the prior's soils at slips `at` (k,), and their band."""
    pulls = driven(case, soils(case, count, rng)[:, None, :], at, run.load).drawbar_pull
    return _alike(pulls, run.pull)


def by_torque(
    case: Case, run: Drive, at: Floats, rng: np.random.Generator, count: int = 2000
) -> Foretold:
    r"""No soil identified: torque over the wheel's radius, less what the prior's soils lose of it.

    .. math:: DP = T / r - R, \qquad R = T / r - DP \text{ over soils of the prior}

    with the pull that is foretold at slips `at` (k,), and the sensor's noise in the losses' spread.
    """
    values = soils(case, count, rng)[:, None, :]
    radius = case.model.gear.radius
    read = noisy(case, driven(case, values, run.slip, run.load).torque, rng)
    lost = read / radius - driven(case, values, at, run.load).drawbar_pull
    found = _alike(lost, run.pull)
    return Foretold(*(run.torque / radius - part for part in (found.pull, found.high, found.low)))


def _alike(samples: Floats, like: Floats) -> Foretold:
    return Foretold(*(np.broadcast_to(part, like.shape) for part in spread(samples)))


def by_estimate(
    case: Case, estimator: Estimator, run: Drive, at: Floats, rng: np.random.Generator
) -> Foretold:
    """From the estimate of each reading alone, the pull at slips `at` (k,)."""
    found = estimator(slip=run.slip, torque=run.torque, load=run.load)
    return Foretold(*band(case, found.mean, found.covariance, at, run.load, rng, DRAWS))


def by_run(
    case: Case, estimator: Estimator, run: Drive, at: Floats, rng: np.random.Generator
) -> Foretold:
    """From all readings of each soil joined, the pull at slips `at` (k,)."""
    load = np.full_like(run.slip, run.load)
    found = [estimator.run(slip=run.slip, torque=row, load=load) for row in run.torque]
    mean = np.stack([one.mean for one in found])
    covariance = np.stack([one.covariance for one in found])
    return Foretold(*band(case, *everywhere(mean, covariance, len(at)), at, run.load, rng, DRAWS))


def by_bayes(
    case: Case, run: Drive, at: Floats, rng: np.random.Generator, count: int = 2**14
) -> tuple[Foretold, Floats]:
    """The best that each reading alone allows: means over the exact posterior.

    Of the drawbar pull at slips `at` (k,), and of the soil's parameters, (m, k, 3).
    """
    values = soils(case, count, rng)
    pull, mean = np.empty_like(run.pull), np.empty((*run.pull.shape, 3))
    for i, slip in enumerate(run.slip):
        here = driven(case, values, slip, run.load).torque
        there = driven(case, values, at[i], run.load).drawbar_pull
        weight = _weights(case, run.torque[:, i, None], here)
        pull[:, i], mean[:, i] = weight @ there, weight @ values
    nothing = np.full_like(pull, np.nan)
    return Foretold(pull, nothing, nothing), mean


def _weights(case: Case, torque: Floats, predicted: Floats) -> Floats:
    """Weights (m, n) of soils drawn from the prior, from one torque (m, 1) and theirs (n,)."""
    std = case.noise["torque_Nm"].std(predicted)
    logs = -0.5 * ((torque - predicted) / std) ** 2 - np.log(std)
    weight = np.exp(logs - logs.max(axis=1, keepdims=True))
    return weight / weight.sum(axis=1, keepdims=True)
