"""Importance sampling where a similar density is known."""

import numpy as np
import pytest

from soilml.numerics.sampling.importance_sampling import importance_sample


def test_samples_drawn_about_the_middle_have_the_moments_of_a_density_of_many_dimensions():
    """Nine dimensions, in which a Latin hypercube has hardly a point where the density is."""
    p, std = 9, 0.03
    mean = 0.5 + std * np.linspace(-1.0, 1.0, p)

    def log_density(u):
        return -0.5 * (((u - mean) / std) ** 2).sum(axis=1)

    found = importance_sample(log_density, p, least_effective_size=1500.0, middle_std=0.045)
    assert found.effective_size >= 1500.0
    assert len(found.u) <= 5 * 2048  # a few rounds
    assert (found.mean(found.u) - mean) / std == pytest.approx(0.0, abs=0.15)
    spread = np.sqrt(found.mean((found.u - mean) ** 2))
    assert spread == pytest.approx(std, rel=0.1)
    assert found.evidence == pytest.approx(p * np.log(np.sqrt(2.0 * np.pi) * std), abs=0.1)
