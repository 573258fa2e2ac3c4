"""Normal priors against scipy's truncated normal distribution."""

import numpy as np
import pytest
from scipy.stats import truncnorm

from soilml.numerics.prior import Prior

U = np.linspace(0.001, 0.999, 41)

KINDS = {
    "normal": (Prior.normal(0.2), truncnorm(-4.0, 4.0, scale=0.2)),
    "half-normal": (Prior.half_normal(0.2), truncnorm(0.0, 4.0, scale=0.2)),
    "cut off": (Prior(-0.1, 0.3, normal_std=0.2), truncnorm(-0.5, 1.5, scale=0.2)),
}


@pytest.mark.parametrize(("prior", "expected"), KINDS.values(), ids=KINDS)
def test_quantiles_are_those_of_the_truncated_normal_distribution(prior, expected):
    assert prior.at(U) == pytest.approx(expected.ppf(U), abs=1e-12)
    assert prior.std == pytest.approx(expected.std(), rel=2e-3)
    back = [prior.fraction(float(value)) for value in prior.at(U)]
    assert back == pytest.approx(U, abs=1e-12)


@pytest.mark.parametrize(("prior", "expected"), KINDS.values(), ids=KINDS)
def test_the_rate_is_the_derivative_of_the_quantile(prior, expected):
    h = 1e-6
    numerical = (prior.at(U + h) - prior.at(U - h)) / (2.0 * h)
    assert prior.rate(U) == pytest.approx(numerical, rel=1e-5)
