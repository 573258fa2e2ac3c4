"""Sampling with polynomials in place of a model, against grids and against the model itself."""

import numpy as np
import pytest

from soilml.numerics.surface_sampling import surface_sample

pytestmark = pytest.mark.slow

SLIP = np.linspace(0.1, 0.9, 12)


class Bent:
    """Readings a (1 - exp(-slip / b)) of two parameters, with normal noise; evaluations counted."""

    def __init__(self, noise=0.01, truth=(0.6, 0.3), missing=None, kink=0.0):
        self.noise, self.missing, self.kink, self.evaluations = noise, missing, kink, 0
        self.reading = self.model(np.asarray([truth]))[0]
        self.evaluations = 0

    def model(self, u):
        a, b = 0.5 + u[:, :1], 0.05 + u[:, 1:]
        y = a * (1.0 - np.exp(-SLIP / b)) + self.kink * np.abs(u[:, :1] - 0.6)
        if self.missing is not None:
            y = np.where(u[:, :1] > self.missing, np.nan, y)
        return y

    def predict(self, u):
        self.evaluations += len(u)
        return self.model(u)

    def of_predictions(self, y):
        return -0.5 * (((y - self.reading) / self.noise) ** 2).sum(axis=1)

    def __call__(self, u):
        logs = self.of_predictions(self.model(u))
        return np.where(np.isfinite(logs), logs, -np.inf)


def moments_by_grid(density, middle, half, count=401):
    axes = [np.linspace(max(m - half, 0), min(m + half, 1), count) for m in middle]
    u = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    weights = np.exp(density(u))
    cell = np.prod([axis[1] - axis[0] for axis in axes])
    evidence = np.log(weights.sum() * cell)
    weights /= weights.sum()
    mean = weights @ u
    return mean, ((u - mean).T * weights) @ (u - mean), evidence


@pytest.mark.parametrize(("noise", "half"), [(0.1, 1.0), (0.01, 0.3), (1e-4, 0.003)])
def test_moments_and_evidence_are_those_of_the_density(noise, half):
    density = Bent(noise)
    sample = surface_sample(density, 2)
    mean, covariance, evidence = moments_by_grid(Bent(noise), (0.6, 0.3), half)
    std = np.sqrt(np.diag(covariance))
    assert np.abs(sample.mean(sample.u) - mean).max() < 0.1 * std.min()
    deviation = sample.u - sample.mean(sample.u)
    found = (deviation.T * sample.weights) @ deviation
    assert found == pytest.approx(covariance, rel=0.1, abs=0.1 * std.min() ** 2)
    assert sample.evidence == pytest.approx(evidence, abs=0.1)
    assert density.evaluations < 1000  # sampling the model takes several thousand


def test_a_kink_in_the_posterior_is_left_to_sampling_of_the_model():
    assert surface_sample(Bent(1e-3, kink=2.0), 2) is None
    smooth_elsewhere = Bent(1e-3, truth=(0.2, 0.3), kink=2.0)  # the posterior is far from the kink
    assert surface_sample(smooth_elsewhere, 2) is not None
