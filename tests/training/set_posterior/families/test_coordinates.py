"""The coordinate of an unknown carries its value and its prior."""

import numpy as np
import pytest

from soilml.numerics.prior import Prior
from training.set_posterior.families.coordinates import PriorAxis

PRIORS = {
    "from zero": Prior(0.0, 3000.0),
    "an angle": Prior(0.43, 0.79),
    "a wide range": Prior(0.005, 0.03),
    "a logarithm": Prior(0.005, 0.03, log=True),
    "around zero": Prior(-1.0, 1.0),
}


@pytest.mark.parametrize("prior", PRIORS.values(), ids=PRIORS)
def test_values_run_from_one_end_of_the_range_to_the_other(prior):
    axis = PriorAxis.of("x", prior)
    values = axis.value(np.linspace(-1.0, 1.0, 101))
    assert values[[0, -1]] == pytest.approx([prior.lower, prior.upper], abs=1e-12 * prior.upper)
    assert (np.diff(values) > 0.0).all()


@pytest.mark.parametrize("prior", PRIORS.values(), ids=PRIORS)
def test_quantiles_are_those_of_the_prior(prior):
    u = np.linspace(0.0, 1.0, 101)
    axis = PriorAxis.of("x", prior)
    assert axis.value(axis.quantile(u)) == pytest.approx(prior.at(u), abs=1e-12 * prior.upper)


@pytest.mark.parametrize("prior", PRIORS.values(), ids=PRIORS)
def test_the_density_is_the_slope_of_the_fraction_below(prior):
    axis, step = PriorAxis.of("x", prior), 1e-6
    u = np.linspace(0.01, 0.99, 31)
    slope = 2.0 * step / (axis.quantile(u + step) - axis.quantile(u - step))
    assert np.log(slope) == pytest.approx(axis.log_density + axis.tilt * axis.quantile(u), abs=1e-6)
