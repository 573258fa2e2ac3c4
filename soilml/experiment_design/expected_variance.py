"""Predicted readings, and the expected posterior variance of each parameter after a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import range_with_zero
from soilml.errors import InputError
from soilml.experiment_design.parameter_samples import ParameterSamples
from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.predictions import predict_channels
from soilml.fitting.readings import LEAST_RELATIVE_STD, Readings
from soilml.numerics.quantiles import systematic_resampling
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, column

#: Largest probability of no equilibrium at a point that is advised.
MOST_FAILURE = 0.05
Floats32 = NDArray[np.float32]

LEAST_LOG = -1e30  # Stands for the logarithm of a vanishing likelihood where it is subtracted
OUTCOMES = 256  # Number of simulated readings


@dataclass(frozen=True)
class PredictedReadings:
    """Readings y (c, m, n) of channels at m operating points for n samples, and their noise.

    NaN where that soil does not carry the wheel; `drivable` (m,) are points at which the
    probability of this is less than `MOST_FAILURE`.
    """

    at: Operating
    channels: tuple[str, ...]
    y: Floats
    std: Floats
    drivable: NDArray[np.bool_]


def predicted_readings(case: Case, samples: ParameterSamples, at: Operating) -> PredictedReadings:
    """Predictions of all channels whose noise the case declares; `at` holds arrays (m,).

    Noise of slip and load is propagated as in the posterior, at the sample nearest to the mean. A
    model discrepancy, or a learned remainder, is added as an error that is independent of those of
    other rows. Raises `InputError` where no noise is declared.
    """
    channels = tuple(name for name in CHANNELS if column(name) in case.noise)
    if not channels:
        raise InputError("the value of a measurement depends on its noise: declare it in [noise]")
    predicted = predict_channels(case, samples.free, samples.u, at)
    y = np.stack([predicted[name].T for name in channels])
    sensor = np.stack(
        [
            np.hypot(case.noise[column(n)].std(v), _model_error(case, n, v, at))
            for n, v in zip(channels, y, strict=True)
        ]
    )
    inputs = _input_noise(case, samples, at, channels)
    std = samples.noise_scale * np.hypot(sensor, inputs[..., None])
    failure = np.isnan(y).any(axis=0) @ samples.weights
    largest = np.nan_to_num(np.abs(y)).max(axis=(1, 2), keepdims=True)
    least = LEAST_RELATIVE_STD * largest + 1e-12
    return PredictedReadings(at, channels, y, np.fmax(std, least), failure < MOST_FAILURE)


def _model_error(case: Case, name: str, y: Floats, at: Operating) -> Floats:
    """Standard deviation (m, 1) of a channel's remainder, or of its declared discrepancy.

    The range of a discrepancy is that of typical readings.
    """
    slip, load = np.broadcast_arrays(*(np.atleast_1d(np.asarray(v)) for v in (at.slip, at.load)))
    if case.remainder is not None and case.remainder.of(name):
        columns = case.remainder.process_columns(name, slip, load, fitted_anew=True)
        return np.asarray(np.sqrt((columns**2).sum(axis=1, keepdims=True)))
    own = case.discrepancy.get(column(name))
    if own is None:
        return np.zeros((len(slip), 1))
    carried = np.isfinite(y).any(axis=1)
    amplitude = own.amplitude(range_with_zero(np.nanmedian(y[carried], axis=1)))
    return np.full((len(slip), 1), amplitude)


def _input_noise(
    case: Case, samples: ParameterSamples, at: Operating, channels: Sequence[str]
) -> Floats:
    """Standard deviation (c, m) of each channel that noise of slip and load causes."""
    slip_std, load_std = (
        case.noise[key].std(value) if key in case.noise else np.zeros_like(value)
        for key, value in (("slip", np.asarray(at.slip)), ("load_N", np.asarray(at.load)))
    )
    rows = replace(Readings.of_every_row(at, channels), slip_std=slip_std, load_std=load_std)
    nearest = samples.u[int(np.argmin((samples.standardised**2).sum(axis=1)))]
    noise = noise_of_operation(case, rows, samples.free, nearest)
    return noise.reshape(len(channels), -1)


@dataclass(frozen=True)
class ExpectedVariance:
    """Simulated outcomes: the sample that each is simulated from, and its standardised noise.

    All candidates share both (common random numbers), so that their differences are not those of
    chance.
    """

    index: NDArray[np.int64]  # (j,) of the samples
    normal: Floats  # (c, j)
    samples: ParameterSamples

    def log_likelihood(
        self, predicted: PredictedReadings, channels: Sequence[str], point: int
    ) -> Floats32:
        """Log likelihood (j, n) of each simulated outcome under each sample, up to a constant.

        A wheel that is not carried is an outcome too: certain under the samples without an
        equilibrium at this point, impossible under the others.
        """
        total = np.zeros((len(self.index), len(self.samples.weights)), dtype=np.float32)
        for name in channels:
            c = predicted.channels.index(name)
            total -= self._squared_deviation(predicted.y[c, point], predicted.std[c, point], c)
        total *= 0.5
        failed = np.asarray(np.isnan(predicted.y[:, point]).any(axis=0))
        if failed.any():
            same = failed[self.index][:, None] == failed
            carried = np.where(failed, np.float32(0.0), total)
            total = np.where(same, carried, np.float32(-np.inf))
        return total

    def _squared_deviation(self, y: Floats, std: Floats, c: int) -> Floats32:
        """Squared standardised deviation plus log variance, (j, n), in single precision."""
        reading = y[self.index] + std[self.index] * self.normal[c]
        deviation = np.multiply.outer(reading.astype(np.float32), (1.0 / std).astype(np.float32))
        deviation -= (y / std).astype(np.float32)
        deviation *= deviation
        deviation += 2.0 * np.log(std).astype(np.float32)
        return np.asarray(deviation)

    def remaining_variance(self, log_likelihood: Floats32) -> Floats:
        r"""Expected posterior variance (p,) in units of the prior's.

        .. math::
            E \operatorname{Var}(\theta | y) \approx \frac{1}{J} \sum_j \frac{1}{2}
            \left[ \sum_i W_{ji} (\theta_i - m_j)^2 + (\theta_j - m_j)^2 \right], \quad
            W_{ji} \propto w_i \, p(y_j | \theta_i), \; i \ne j, \quad m_j = \sum_i W_{ji} \theta_i

        The sample that an outcome is simulated from is left out of its posterior. Both terms
        converge to the variance as the samples grow dense. Where few samples lie within the noise,
        the first is too small and the second too large by the same amount, which cancels in their
        mean. The result is at most the current variance, as no reading widens a posterior on
        average.

        References: Lindley, Annals of Mathematical Statistics 27, 1956. Chaloner and Verdinelli,
        Statistical Science 10, 1995, section 2.
        """
        theta = self.samples.standardised
        weights = self._leave_one_out_weights(log_likelihood)
        own = theta[self.index]
        columns = np.column_stack([np.ones(len(theta)), theta, theta**2])
        sums = (weights @ columns.astype(np.float32)).astype(np.float64)
        total = sums[:, 0]
        isolated = total == 0.0  # no other sample can produce this outcome
        moments = sums[:, 1:] / np.where(isolated, 1.0, total)[:, None]
        mean, mean_square = np.split(moments, 2, axis=1)
        mean[isolated] = own[isolated]
        mean_square[isolated] = mean[isolated] ** 2
        within = mean_square - mean**2
        expected = 0.5 * (within + (own - mean) ** 2).mean(axis=0)
        return np.asarray(np.minimum(expected, self.samples.remaining_fraction**2))

    def _leave_one_out_weights(self, log_likelihood: Floats32) -> Floats32:
        """Posterior weights (j, n) up to a factor of each outcome, zero for its own sample."""
        weight = log_likelihood + np.log(self.samples.weights).astype(np.float32)
        weight[np.arange(len(self.index)), self.index] = -np.inf
        weight -= np.maximum(weight.max(axis=1, keepdims=True), np.float32(LEAST_LOG))
        np.exp(weight, out=weight)
        return np.asarray(weight)


def expected_variance(
    samples: ParameterSamples, channels: int, count: int = OUTCOMES, seed: int = 0
) -> ExpectedVariance:
    """Outcomes of `count` samples, resampled by their weights, for a number of channels."""
    offset = np.random.default_rng(seed).random()
    index = systematic_resampling(samples.weights, count, offset)
    normal = np.random.default_rng(seed).standard_normal((channels, count))
    return ExpectedVariance(index, normal, samples)
