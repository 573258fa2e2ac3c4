"""A density in logarithms of some variables, against the same in the variables themselves."""

import numpy as np
import pytest
from soilml.numerics.surface_sampling import normal_sample, surface_sample
from soilml.numerics.surrogate_density import LogarithmicDensity

from soilml.numerics.importance_sampling import importance_sample

RATIO = np.asarray([50.0, 1.0, 4.0])


class Valley:
    """Readings that are a power of the first variable's value, with a second in the exponent."""

    loads = np.linspace(0.5, 2.0, 6)

    def predict(self, u):
        modulus, exponent = 1.0 + 49.0 * u[:, :1], 0.5 + u[:, 1:2]
        return np.hstack([(self.loads / modulus) ** (1.0 / exponent), 1.0 + 3.0 * u[:, 2:]])

    def of_predictions(self, y):
        middle = self.predict(np.asarray([[0.2, 0.5, 0.4]]))
        scatter = np.append(np.full(6, 0.02), 0.2)
        return -0.5 * (((y - middle) / scatter) ** 2).sum(axis=1)


def density(u):
    return Valley().of_predictions(Valley().predict(u))


def test_there_and_back_are_inverse_and_the_rate_is_the_derivative():
    logs, rng = LogarithmicDensity(Valley(), RATIO), np.random.default_rng(0)
    u = rng.random((20, 3))
    v = logs.logarithmic(u)
    np.testing.assert_allclose(logs.linear(v), u, atol=1e-12)
    np.testing.assert_array_equal(v[:, 1], u[:, 1])
    # uniform between 1 and 50: half of the range of the logarithm is the root of 50
    middle = logs.linear(np.full((1, 3), 0.5))[0]
    np.testing.assert_allclose(middle, [(np.sqrt(50.0) - 1.0) / 49.0, 0.5, 1.0 / 3.0])
    step = 1e-6
    rates = [(logs.linear(v + step * np.eye(3)[i]) - logs.linear(v))[:, i] / step for i in range(3)]
    np.testing.assert_allclose(logs.log_rate(v), np.log(rates).sum(axis=0), atol=1e-4)
    own, root = logs.around(u[0], np.eye(3))
    np.testing.assert_allclose(own, v[0])
    np.testing.assert_allclose(np.diag(root) * np.asarray(rates)[:, 0], 1.0, rtol=1e-4)


def test_samples_are_those_of_the_density_over_the_variables():
    logs = LogarithmicDensity(Valley(), RATIO)
    start = normal_sample(*logs.around(np.asarray([0.2, 0.5, 0.4]), 0.05 * np.eye(3)))
    quick = logs.back(surface_sample(logs, 3, start))
    whole = importance_sample(density, 3, least_effective_size=20_000.0, seed=3)
    assert quick.evidence == pytest.approx(whole.evidence, abs=0.05)
    mean = whole.mean(whole.u)
    std = np.sqrt(whole.mean((whole.u - mean) ** 2))
    assert np.abs((quick.mean(quick.u) - mean) / std).max() < 0.08
    ends = np.asarray([0.03, 0.5, 0.97])
    off = (quick.quantiles(quick.u, ends) - whole.quantiles(whole.u, ends)) / std
    assert np.abs(off).max() < 0.2
