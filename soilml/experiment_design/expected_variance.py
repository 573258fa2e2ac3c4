"""The width that is expected to remain of each parameter after a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.experiment_design.parameter_samples import ParameterSamples
from soilml.experiment_design.predicted_readings import PredictedReadings
from soilml.numerics.resampling import systematic_resampling

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

#: Logarithm of a likelihood that no sample has.
LEAST_LOG = -1e30
#: Soils among the samples whose readings are simulated.
OUTCOMES = 256


@dataclass(frozen=True)
class ExpectedVariance:
    """Soils `index` (j,) taken for true in turn, and the standard normal draws of their noise.

    All candidates share both, so that their differences are not those of luck.
    """

    index: NDArray[np.int64]
    normal: Floats  # (c, j)
    belief: ParameterSamples

    def with_noise(self, seed: int) -> ExpectedVariance:
        """The same soils with fresh noise, for another row."""
        normal = np.random.default_rng(seed).standard_normal(self.normal.shape)
        return replace(self, normal=normal)

    def logs(self, foreseen: PredictedReadings, channels: Sequence[str], point: int) -> Floats32:
        """Logarithm of the likelihood (j, n) of each simulated reading under each sample.

        A wheel that is stuck is a reading too: of the soils that do not carry it, and of no other.
        """
        total = np.zeros((len(self.index), len(self.belief.weights)), dtype=np.float32)
        for name in channels:
            c = foreseen.channels.index(name)
            y, std = foreseen.y[c, point], foreseen.std[c, point]
            read = y[self.index] + std[self.index] * self.normal[c]
            scale = (1.0 / std).astype(np.float32)
            off = np.multiply.outer(read.astype(np.float32), scale)
            off -= (y / std).astype(np.float32)
            off *= off
            off += 2.0 * np.log(std).astype(np.float32)
            total -= off
        total *= 0.5
        stuck = np.asarray(np.isnan(foreseen.y[:, point]).any(axis=0))
        if stuck.any():
            same = stuck[self.index][:, None] == stuck
            total = np.where(same, np.where(stuck, np.float32(0.0), total), np.float32(-np.inf))
        return total

    def remaining(self, logs: Floats32) -> Floats:
        r"""Expected variance (p,) in squared standard deviations of the prior.

        .. math::
            E \operatorname{Var}(\theta | y) \approx \frac{1}{J} \sum_j \frac{1}{2}
            \left[ \sum_i W_{ji} (\theta_i - m_j)^2 + (\theta_j - m_j)^2 \right], \quad
            W_{ji} \propto w_i \, p(y_j | \theta_i), \; i \ne j, \quad m_j = \sum_i W_{ji} \theta_i

        The soil that made the reading takes no part in what is inferred from it. Both terms are
        the variance as the samples grow dense; where few lie within the noise, the first is too
        small and the second too large by the same share, which cancels in their mean. On average no
        reading widens what is believed. References: Lindley, Annals of Mathematical Statistics 27,
        1956; Chaloner and Verdinelli, Statistical Science 10, 1995, section 2 (the expected
        posterior variance as what an experiment is worth).
        """
        weight = logs + np.log(self.belief.weights).astype(np.float32)
        weight[np.arange(len(self.index)), self.index] = -np.inf
        weight -= np.maximum(weight.max(axis=1, keepdims=True), np.float32(LEAST_LOG))
        np.exp(weight, out=weight)
        shares = self.belief.shares
        columns = np.column_stack([np.ones(len(shares)), shares, shares**2])
        sums = (weight @ columns.astype(np.float32)).astype(np.float64)
        alone = sums[:, 0] == 0.0  # no other sample could have read so
        mean, square = np.split(sums[:, 1:] / np.where(alone, 1.0, sums[:, 0])[:, None], 2, axis=1)
        mean[alone] = shares[self.index[alone]]
        square[alone] = mean[alone] ** 2
        off = shares[self.index] - mean
        found = 0.5 * (square - mean**2 + off**2).mean(axis=0)
        return np.asarray(np.minimum(found, self.belief.left**2))


def expected_variance(
    belief: ParameterSamples, channels: int, count: int = OUTCOMES, seed: int = 0
) -> ExpectedVariance:
    """Soils of a belief to be taken for true in turn, as probable as it says."""
    index = systematic_resampling(belief.weights, count, np.random.default_rng(seed).random())
    return ExpectedVariance(index, np.zeros((channels, count)), belief).with_noise(seed)
