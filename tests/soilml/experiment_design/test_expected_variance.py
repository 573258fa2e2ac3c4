"""Expected widths are those of brute force, and behave as information does."""

import numpy as np
import pytest

from soilml import Operating, read_case
from soilml.experiment_design.expected_variance import (
    PredictedReadings,
    expected_variance,
    predicted_readings,
)
from soilml.experiment_design.parameter_samples import samples_of_prior
from soilml.fitting.coordinates import Coordinate, select_free
from soilml.numerics.prior import Prior


def line(count, seed=0):
    """Samples of one parameter, uniform from 0 to 1."""
    return samples_of_prior([Coordinate("a", "1", Prior(0.0, 1.0), 0.5, False)], count, seed)


def read(samples, y, std):
    """One channel at one point that reads y (n,) with a noise of std."""
    at = Operating(slip=np.zeros(1), load=np.ones(1))
    shape = (1, 1, len(y))
    noise = np.broadcast_to(std, shape).copy()
    return PredictedReadings(at, ("torque",), y.reshape(shape), noise, np.ones(1, dtype=bool))


def remaining_fraction(samples, y, std, count=256, seed=1):
    outcomes = expected_variance(samples, 1, count, seed)
    return np.sqrt(
        outcomes.remaining_variance(outcomes.log_likelihood(read(samples, y, std), ("torque",), 0))
    )[0]


def integrated(f, std, points=800):
    """Root expected posterior variance over the prior's of a uniform parameter, by quadrature."""
    x = (np.arange(points) + 0.5) / points
    y = np.linspace(f(x).min() - 6 * std, f(x).max() + 6 * std, 1500)
    likelihood = np.exp(-0.5 * ((y[:, None] - f(x)) / std) ** 2)
    evidence = likelihood.mean(axis=1)
    mean = likelihood @ x / points / evidence
    variance = likelihood @ x**2 / points / evidence - mean**2
    return np.sqrt(np.sum(evidence * variance) / np.sum(evidence) * 12.0)


@pytest.mark.parametrize("std", [2.0, 0.3, 0.03])
def test_one_parameter_is_left_as_wide_as_quadrature_says(std):
    def bent(x):
        return (2.0 * x - 0.6) ** 2  # two values of x give one reading

    samples = line(1500)
    found = np.mean(
        [remaining_fraction(samples, bent(samples.u[:, 0]), std, seed=k) for k in range(8)]
    )
    assert found == pytest.approx(integrated(bent, std), rel=0.04)


@pytest.mark.slow
def test_rows_of_the_wheel_are_left_as_by_brute_force(model_file):
    """Against importance sampling with twenty times the samples, simulated readings apart."""
    case = read_case(model_file)
    free = select_free(case, None)
    at = Operating(slip=np.asarray([0.05, 0.3, 0.6]), load=np.asarray([120.0, 60.0, 30.0]))
    found = np.zeros((3, 3))
    for seed in range(4):
        samples = samples_of_prior(free, 1000, seed)
        ahead, outcomes = (
            predicted_readings(case, samples, at),
            expected_variance(samples, 1, 400, seed),
        )
        found += [
            outcomes.remaining_variance(outcomes.log_likelihood(ahead, ("torque",), k)) / 4
            for k in range(3)
        ]
    many = samples_of_prior(free, 20000, seed=7)
    y = predicted_readings(case, many, at).y[0]
    rng = np.random.default_rng(8)
    for k in range(3):
        variance = []
        for j in rng.integers(0, 20000, 500):
            std = 0.02 * y[k]
            reading = y[k][j] + std[j] * rng.standard_normal()
            weight = np.exp(-0.5 * ((reading - y[k]) / std) ** 2) / std
            mean = weight @ many.standardised / weight.sum()
            variance.append(weight @ many.standardised**2 / weight.sum() - mean**2)
        np.testing.assert_allclose(
            np.sqrt(found[k]), np.sqrt(np.mean(variance, axis=0)), atol=0.045
        )
